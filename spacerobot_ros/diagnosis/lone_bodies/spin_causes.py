"""Spinning bodies that have a gyro and a magnetometer, and no attitude: what their means tell.

What both sensors see of the axis is the body's, or that of a board on which both sit: it is said
to be likely, with that rival.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from scipy.special import chdtrc

from ...effects.bodies.bodies import InertialParameters
from ...effects.effect import Effect, Key
from ...effects.prior import Scale
from ...effects.sensors.sensor_errors import GyroBias, GyroMisalignment, GyroScale
from ...errors import RecordingError
from ...estimation.columns import candidate_at
from ...estimation.noise_levels import noise_levels
from ...estimation.scaling import is_relevant
from ...estimation.spin import LONGEST, TURNS, nutation, spin_windows
from ...estimation.spin_rows import SpinRows
from ...formats import counted
from ...inference.decisive import CONFOUNDED, IMPLAUSIBLE, MISFIT
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import Inferred, InferredCause, infer
from ...inference.validation import HeldOut
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..answer.cause import Cause, Estimated, Evidence, Rival
from ..answer.residuals import residuals
from ..answer.result import Diagnosis, Gain, Series
from ..answer.words import verdict_of
from ..limits import CLEAR
from ..search.conclusion import sentence_of

_FAULTS = (GyroBias, GyroScale, GyroMisalignment)
_FEWEST = 4  # windows
_BOARD = Rival(
    effect=GyroMisalignment.id, where='gyro and magnetometer on one board', log_odds=0.0
)
_TILTED = 'gyro and magnetometer sit on one tilted board'
_NEXT = (
    'Spin it about another axis and record again: a board that is tilted stays so, a principal '
    'axis does not follow.'
)
_STEP = 1e-3  # of a deviation, for derivatives


def is_spinning(records: Sequence[Record], robot: Robot) -> bool:
    """Whether recordings are judged by the spin: a lone body's gyro and magnetometer alone."""
    return not robot.joints and all(
        r.attitudes is None and len(r.gyro_axes) == len('xyz') and 'magnetic_field' in r.inputs
        for r in records
    )


def diagnose_spin(records: Sequence[Record], robot: Robot) -> Diagnosis:
    """What gyro and magnetometer of a spinning body tell, of all its recordings together.

    Raises:
        RecordingError: too few windows in which it spins.
    """
    windows = spin_windows(records)
    if len(windows) < _FEWEST:
        raise RecordingError(
            records[0].source,
            f'{counted(len(windows), "window")} in which the magnetometer sees the body spin, at '
            f'least {_FEWEST} of {TURNS:g} turns are needed: without an attitude nothing else is '
            'judged',
        )
    line = nutation(windows)
    seen = line if line.p_value < MISFIT else None
    levels = [noise_levels(robot.sensors, record)[0].gyro for record in records]
    faults = [c for kind in _FAULTS if (c := candidate_at(kind, robot, None, {}))]
    steps = [step for c in faults for step in c.small_steps]
    noise = np.array([levels[w.recording] for w in windows])
    spins = _Spins(SpinRows(windows, noise, steps, robot, seen), robot)
    count = counted(len({w.recording for w in windows}), 'recording')
    spans = f'{counted(len(windows), "window")} of up to {LONGEST:g} s of {count}'
    notes = [f'judged by the spin that the magnetometer sees: {spans}']
    if seen is not None:
        apart = 100.0 * np.min(np.abs(spins.rows.apart / spins.rows.moments[spins.rows.others]))
        share = f'nutation at {seen.share:.4f} +- {seen.std:.2g} of the spin'
        notes.append(f'{share}: its moment and the nearest other are {apart:.2g} % apart')
    return spins.diagnosis(tuple(notes))


class _Spins:
    """Rows of windows, and what is wrong by them.

    Args:
        rows: Of all windows.
        robot: The robot file's.
    """

    def __init__(self, rows: SpinRows, robot: Robot) -> None:
        self.rows, self.robot, self._every = rows, robot, _hypotheses(robot)
        self.found = self._inferred()
        turned = self.found.mean.copy()
        turned[: len(GyroBias.parameters)] = 0.0
        sines = rows.across(turned)
        rows.about(math.sqrt(max(1.0 - float(sines @ sines), 0.0)))
        self.found = self._inferred()
        self.causes = {cause.key: cause for cause in self.found.causes}

    def _inferred(self) -> Inferred:
        sizes = np.concatenate([h.slab for h in self._every])
        self._blocks = self.rows.blocks(self.rows.stds(sizes))
        return infer(self._blocks, self._every)

    def diagnosis(self, notes: tuple[str, ...]) -> Diagnosis:
        """The answer."""
        faults = [cause for kind in _FAULTS if (cause := self._fault(kind))]
        body, tilt = self._body()
        causes = sorted([*faults, *body], key=lambda c: -c.evidence.log_odds)
        named = tuple(c for c in causes if c.relevant)
        mean = self.found.mean
        fit_p = self._p_value(mean, sum(len(c.parameters) for c in causes))
        is_huge = any(cause.slabs > IMPLAUSIBLE for cause in self.found.causes)
        verdict = verdict_of(fit_p >= MISFIT and not is_huge, bool(named))
        doubt = f'but by {IMPLAUSIBLE:g} times of what is plausible or more' * is_huge
        minor = tuple(c for c in causes if not c.relevant)
        said = sentence_of(verdict, named, minor, doubt, 'more than the noise of the gyro')
        channels = self._series()
        chosen = [i for i, h in enumerate(self._every) if h.key in self.causes]
        held_out = HeldOut(Hypotheses(self._blocks, self._every), chosen).squares()
        before, after = (math.sqrt(float(np.sum(x)) / self.rows.data.size) for x in held_out)
        return Diagnosis(
            verdict=verdict,
            sentence=f'{said}{tilt}',
            causes=named,
            minor=minor,
            residuals=residuals(channels, (), (), ()),
            series=channels,
            gain=Gain(before=before, after=after),
            fit_p=fit_p,
            null_p=self._p_value(np.zeros_like(mean), 0),
            next_motion=(_NEXT,) if tilt else (),
            notes=notes,
            method='spin',
        )

    def _p_value(self, mean: Array, numbers: int) -> float:
        """Probability of as much left of the gyro by the noise of its samples alone."""
        own = self.rows.axis < len('xyz')
        left = self.rows.left(mean)[:, own] / self.rows.noise[:, own]
        return float(chdtrc(max(left.size - numbers, 1), float(np.sum(left**2))))

    def _covariance(self, cause: InferredCause) -> Array:
        """(k, k) of its coefficients, cluster-robust."""
        robust = self.found.covariance
        assert robust is not None  # of causes
        at = np.searchsorted(robust.columns, cause.hypothesis.columns)
        return robust.matrix[np.ix_(at, at)]

    def _fault(self, kind: type[Effect]) -> Cause | None:
        """Of the gyro, about the axes where it is a cause."""
        axes = [p.name for p in kind.parameters]
        found = {name: c for name in axes if (c := self.causes.get((kind.id, name)))}
        numbers = {n: (c.values[0], self._covariance(c)[0, 0] ** 0.5) for n, c in found.items()}
        return _cause(kind, None, numbers, [*found.values()], self.robot) if found else None

    def _body(self) -> tuple[list[Cause], str]:
        """Inertia that differs from the file's, and its tilt in words.

        A tilt is what both sensors see, half of what they are turned against each other off.
        """
        rows, base = self.rows, self.robot.base_link
        found = self.causes.get((InertialParameters.id, base))
        if found is None:
            return [], ''
        mount, between = self._turned()
        change, covariance = found.values.copy(), self._covariance(found)
        change[:2] += 0.5 * between * rows.apart
        covariance[:2, :2] += np.diag((0.5 * mount * rows.apart) ** 2)
        stds = np.sqrt(np.diag(covariance))
        names = [p.name for p in InertialParameters.parameters_at(self.robot, base)]
        file = self.robot.bodies[0].inertia

        def numbers(at: Array) -> Array:
            """Of an inertia whose ixx is the file's."""
            inertia = file.copy()
            inertia[rows.main, rows.main] += at[2]
            inertia[rows.others, rows.main] += at[:2]
            inertia[rows.main, rows.others] += at[:2]
            inertia *= file[0, 0] / inertia[0, 0]
            return np.array(
                [(inertia - file)['xyz'.index(n[1]), 'xyz'.index(n[2])] for n in names]
            )

        moved = [numbers(change + d) for d in np.diag(_STEP * stds)]
        slopes = (np.array(moved) - numbers(change)) / (_STEP * stds[:, None])
        spread = np.sqrt(np.diag(slopes.T @ covariance @ slopes))
        told = {  # what no nutation tells is as uncertain as it was
            name: (value, std)
            for name, value, std in zip(names, numbers(change), spread, strict=True)
            if 0.0 < std < found.hypothesis.slab[0]
        }
        cause = _cause(InertialParameters, base, told, [found], self.robot)
        parts, total = list[str](), change[:2] + rows.products
        for k, axis in enumerate(rows.others):
            if abs(change[k]) > CLEAR * stds[k]:
                angle, wide = np.degrees(np.arctan(np.abs([total[k], stds[k]]) / rows.apart[k]))
                where = f'off {"xyz"[rows.main]} towards {"xyz"[axis]}'
                parts.append(f'{abs(angle):.2g} +- {abs(wide):.1g} deg {where}')
        if parts:  # of a tilt no odds are known against that of a board
            evidence = replace(cause.evidence, log_odds=_BOARD.log_odds)
            cause = replace(cause, rivals=(_BOARD,), evidence=evidence)
        tilt = f' Likely its principal axis lies {" and ".join(parts)}, or {_TILTED}.'
        return [replace(cause, relevant=True)], tilt * bool(parts)

    def _turned(self) -> tuple[float, Array]:
        """What is tolerated of the gyro against the magnetometer, and (2,) what it is of that."""
        spikes = np.concatenate([h.spike * (h.key not in self.causes) for h in self._every])
        mean = self.found.mean * (spikes > 0.0)
        return max(float(h.spike[0]) for h in self._every), self.rows.across(mean)

    def _series(self) -> tuple[Series, ...]:
        rows, out = self.rows, list[Series]()
        every = rows.data, rows.left(self.found.mean), rows.noise
        for i, axis in enumerate('xyz'):
            before, after, noise = (x[:, rows.axis == i].ravel() for x in every)
            place = np.linspace(0.0, len(rows.data), len(before), endpoint=False)
            floor = float(np.sqrt(np.mean(noise**2)))
            out.append(Series(f'gyro/{axis}', 'rad/s', place, np.zeros(0), before, after, floor))
        return tuple(out)


def _hypotheses(robot: Robot) -> list[Hypothesis]:
    """Faults of the gyro axis by axis; products and main moment of the inertia."""
    out = list[Hypothesis]()
    for kind in _FAULTS:
        sizes = np.array([p.size for p in kind.parameters])
        prior = kind.prior(Scale(sizes=sizes, interval=0.0, gravity=np.zeros(3)))
        assert prior is not None  # of a gyro
        for p, slab, spike in zip(kind.parameters, prior.slab, prior.spike, strict=True):
            key, own = (kind.id, p.name), np.array([len(out)])
            out.append(Hypothesis(key=key, columns=own, slab=slab[None], spike=spike[None]))
    size = InertialParameters.parameters_at(robot, robot.base_link)[0].size
    key, own = (InertialParameters.id, robot.base_link), len(out) + np.arange(3)
    out.append(Hypothesis(key=key, columns=own, slab=np.full(3, size), spike=np.zeros(3)))
    return out


def _cause(
    kind: type[Effect],
    where: str | None,
    numbers: Mapping[str, tuple[float, float]],
    found: Sequence[InferredCause],
    robot: Robot,
) -> Cause:
    """A cause that some hypotheses are, with values and deviations of its numbers.

    What nothing stands in for may be within what is tolerated of the gyro's mount.
    """
    parameters = {p.name: p for p in kind.parameters_at(robot, where) if p.name in numbers}
    odds = {}
    for c in found:
        if c.log_odds < CONFOUNDED and not c.alternatives[0].causes:
            odds[GyroMisalignment.id] = c.log_odds
        odds |= {cast(Key, key)[0]: a.log_odds for a in c.rivals for key in a.causes}
    values = {name: float(value) for name, (value, _) in numbers.items()}
    return Cause(
        applied=kind(name=kind.id, where=where, values={**kind.nominal(), **values}),
        parameters={
            name: Estimated(value=values[name], std=float(std), unit=parameters[name].unit)
            for name, (_, std) in numbers.items()
        },
        evidence=Evidence(
            log_odds=max(c.log_odds for c in found),
            elpd_gain=float(np.sum([np.sum(c.gains) for c in found])),
        ),
        rivals=tuple(Rival(effect=e, where=None, log_odds=odds[e]) for e in odds),
        thresholds=parameters,
        relevant=any(is_relevant(parameters[name], value) for name, value in values.items()),
    )
