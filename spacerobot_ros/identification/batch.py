"""Identification from a whole record: `spacerobot identify`.

Joint columns that are swapped in positions and rates alike are found by what breaks: momentum.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.trajectory.reference import Kinematics, NoiseLevels
from ..estimation.unknowns.torque_hold import find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.faults.joint_limits import with_stops
from ..recording.faults.motion_faults import contradictions
from ..recording.record import Record
from ..types import Array, IntArray
from .least_squares import solve_least_squares
from .maximum_likelihood import MaximumLikelihood, prepare
from .online import OnlineIdentifier
from .outliers import screened
from .summary import Identification, Source, conclude
from .validity_limits import EXCHANGED_MISFIT, SHORTEST

METHODS = ('ml', 'recursive', 'ls')


@np.errstate(over='ignore', invalid='ignore', divide='ignore')  # what is not finite is no solution
def identify(
    record: Record,
    robot: Robot,
    settings: IdentifierSettings,
    method: str = 'ml',
    on_pass: Callable[[int], None] = lambda _: None,
) -> Identification:
    """Estimate wheel momentum, bodies and minimal parameters from a record.

    Args:
        record: Joint states, gyro and attitude.
        robot: What the robot file believes.
        settings: The identifier's settings.
        method: `ml` (maximum likelihood on the momentum filter), `recursive` (the same as the
            identifier node does it, sample by sample) or `ls` (the paper's least squares).
        on_pass: Called with the number of passes of `ml` that are done.

    Raises:
        IdentificationError: unknown method, or a record without what is needed.
        ConfigurationError: fixed base; with `ls` sliding joints.
    """
    if method not in METHODS:
        raise IdentificationError(f'method {method!r} is not one of {", ".join(METHODS)}')
    refuse_incomplete(record)
    if method == 'recursive':
        return _recursive(record, robot, settings)
    record = with_stops(record, robot)
    noise, notes = noise_levels(robot.sensors, record, is_checked=False)
    faults = contradictions(record)
    if method == 'ls':
        source = _source(record, notes, faults)
        return Identification(solve_least_squares(record, robot, settings, noise, source))
    model = MomentumModel(robot, settings.structure, settings.nuisances)
    found, kinematics = _likeliest(model, settings, record, noise, on_pass)
    if not found.is_explained:
        kept, left_out = screened(record, noise)
        again = _likeliest(model, settings, kept, noise)[0] if left_out else found
        if again.is_explained:
            found, record, notes = again, kept, (*notes, *left_out)
            faults = contradictions(kept)
        else:
            faults += swapped_joints(model, kinematics, robot.joints[: model.n])
    return conclude(found, 'ml', _source(record, notes, faults))


def _source(record: Record, notes: tuple[str, ...], faults: tuple[str, ...]) -> Source:
    stamp_ns = record.origin_ns + round(record.span[1] * 1e9)
    return Source(len(record.q), stamp_ns, (*record.notes, *notes), faults)


def _likeliest(
    model: MomentumModel,
    settings: IdentifierSettings,
    record: Record,
    noise: NoiseLevels,
    on_pass: Callable[[int], None] = lambda _: None,
) -> tuple[MaximumLikelihood, Kinematics]:
    """What maximum likelihood finds, and the motion that it is of."""
    stretch = prepare(record, noise, find_holds(record, settings.torque_hold_period))
    likelihood = MaximumLikelihood(model, settings)
    likelihood.solve(stretch, on_pass)
    return likelihood, stretch.kinematics


def _recursive(record: Record, robot: Robot, settings: IdentifierSettings) -> Identification:
    """What the identifier node finds of a record that comes at its stamps."""
    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is None or joints.velocity is None or rates is None or attitudes is None:
        raise IdentificationError(f'{record.source}: method `recursive` needs joint rates')
    identifier = OnlineIdentifier(robot, settings)
    series: tuple[tuple[Callable[..., None], tuple[Array | IntArray, ...]], ...] = (
        (identifier.add_joints, (joints.stamp_ns, joints.position, joints.velocity)),
        (identifier.add_rate, (rates.stamp_ns, rates.omega)),
        (identifier.add_attitude, (attitudes.stamp_ns, attitudes.q_xyzw)),
    )
    period_ns = round(settings.solve_period * 1e9)
    until = min(int(stamps[0]) for _, (stamps, *_) in series) + period_ns
    samples = heapq.merge(*(_fed(*own) for own in series), key=lambda sample: sample[0])
    for stamp_ns, add, own in samples:
        while stamp_ns > until:
            identifier.solve()
            until += period_ns
        add(stamp_ns, *own)
    identifier.solve()
    found = identifier.last
    estimate = replace(found.estimate, method='recursive')
    return replace(found, estimate=replace(estimate, notes=(*record.notes, *estimate.notes)))


def refuse_incomplete(record: Record) -> None:
    """Refuse a record that is no run of a free-floating robot.

    Raises:
        IdentificationError: a sensor is missing, or the record is too short.
    """
    topics = {'joints': '/joint_states', 'rates': '/imu/data', 'attitudes': '/attitude'}
    missing = [topic for name, topic in topics.items() if getattr(record, name) is None]
    if missing:
        raise IdentificationError(f'{record.source}: has no {", no ".join(missing)}')
    start, end = record.span
    if end - start < SHORTEST:
        raise IdentificationError(
            f'{record.source}: {end - start:.2f} s is too short to identify from'
        )


_ROWS = 200  # times at which momentum is compared


def _fed(
    add: Callable[..., None], series: tuple[Array | IntArray, ...]
) -> Iterator[tuple[int, Callable[..., None], list[Array]]]:
    """Stamps [ns] of a sensor's samples, what takes them, and their values."""
    for stamp_ns, *values in zip(*series, strict=True):
        yield int(stamp_ns), add, values


def swapped_joints(
    model: MomentumModel, reference: Kinematics, joints: tuple[str, ...]
) -> tuple[str, ...]:
    """The pair of joints whose exchange makes momentum hold, in a line; empty where none does."""
    sparse = reference.part(slice(None, None, max(1, len(reference.time) // _ROWS)))
    misfits = {}
    for pair in combinations(range(model.n), 2):
        order = np.arange(model.n)
        order[list(pair)] = pair[::-1]
        exchanged = replace(sparse, q=sparse.q[:, order], qd=sparse.qd[:, order])
        misfits[pair] = _momentum_misfit(model, exchanged)
    least = min(misfits, key=misfits.__getitem__, default=None)
    if least and misfits[least] < EXCHANGED_MISFIT * _momentum_misfit(model, sparse):
        a, b = (joints[k] for k in least)
        return (f'the columns of {a} and {b} seem to be swapped',)
    return ()


def _momentum_misfit(model: MomentumModel, motion: Kinematics) -> float:
    """Momentum that no momenta explain, the bodies being the file's, in units of what moves.

    Exchanged columns miss by all that a joint moves, wrong bodies by their uncertainty.
    """
    missing, columns = model.balance(motion, model.prior())
    rows = columns[..., : model.y.start].reshape(-1, model.y.start)
    solution = np.linalg.lstsq(rows, -missing.ravel(), rcond=1e-12)[0]
    return float(np.linalg.norm(rows @ solution + missing.ravel()))
