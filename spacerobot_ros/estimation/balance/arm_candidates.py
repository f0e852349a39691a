"""What may be wrong with an arm, and where: the catalogue, as far as its motion could show it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...model.robot import Robot
from ..columns import Candidate, candidate_at
from .balance import Balance

_PER_TURN = (1.0, 2.0)
"""Harmonics of a torque ripple: eccentricity and misalignment. Faster ones of a usual motion are
above the band, and what the data seem to say of them is something else (docs/real_machines.md).
Over less than half a period they are any curve: a weight, a spring, an inertia of a swing."""
_STRIBECK = 0.1  # of the 95 % rate
_BY_PATH = ('joint_presliding_friction',)
"""Effects with a state of their own that the path of a joint gives."""
_DISPLACEMENTS = (1e-3, 3e-3, 1e-2, 3e-2)  # rad, over which dry friction builds up
_TOGETHER = 0.05  # of a recording, in which two joints must show what couples them, either way
_CLEARLY = 0.1  # of a rate, which the sum of two exceeds where its sign counts
GAIN = 'joint_torque_constant'
ZEROS = ('torque_sensor_bias', 'current_offset')
"""Of sensors, which may be set anew before each recording."""
_REVERSALS = 4.0  # displacements that a motion must cover to slide at all, and back


def arm_candidates(
    kinds: Iterable[type[Effect]], balances: Sequence[Balance]
) -> Iterable[Candidate]:
    """Every effect of a catalogue at every place where the recordings could show it.

    Args:
        kinds: The catalogue.
        balances: The model along every recording.
    """
    robot = balances[0].robot
    for kind in kinds:
        if not may_be_on_an_arm(kind):
            continue
        for where in kind.fitted_places(robot):
            beside = (e for e in balances[0].effects if e.where == where)
            if any(e.id in kind.excludes or kind.id in e.excludes for e in beside):
                continue
            for variant in _variants(kind, where, balances):
                candidate = candidate_at(kind, robot, where, variant)
                if candidate is not None:
                    yield candidate


def may_be_on_an_arm(kind: type[Effect]) -> bool:
    """Whether an effect is asked for where torques are balanced."""
    has_path = not kind.hidden or kind.id in _BY_PATH
    return kind.is_fitted and not kind.needs_free_base and has_path


def candidates_of_recordings(
    shared: Sequence[Candidate], robot: Robot, count: int, loaded: Sequence[int]
) -> Iterable[Candidate]:
    """What may be another one in some recordings, beside what the machine has in all of them.

    Zeros of sensors in each one, as long as that no more than doubles the columns: among more
    recordings they are a slow part of the level of what is left. A load where one is declared.

    Args:
        shared: The catalogue's candidates.
        robot: The robot.
        count: Number of recordings.
        loaded: Those with the same load at the last link.
    """
    zeros = [c for c in shared if c.kind.id in ZEROS]
    if count > 1 and count * len(zeros) <= sum(len(c.sizes) for c in shared):
        for run in range(count):
            yield from (_of_recordings(c, (run,)) for c in zeros)
    payloads = [('inertial_parameters', link) for link in robot.last_links]
    if 0 < len(loaded) < count:
        yield from (_of_recordings(c, tuple(loaded)) for c in shared if c.key in payloads)


def _of_recordings(candidate: Candidate, recordings: tuple[int, ...]) -> Candidate:
    """The same in some recordings, where it is not there unless it is a cause."""
    prior = candidate.prior
    if prior is not None:
        prior = replace(prior, spike=np.zeros(len(candidate.sizes)))
    return replace(candidate, recordings=recordings, prior=prior)


def _variants(
    kind: type[Effect], where: str | None, balances: Sequence[Balance]
) -> list[dict[str, float]]:
    """Values of what an effect is not linear in, as an arm's motion suggests them."""
    if where not in balances[0].robot.joints:
        return [{}]
    j = balances[0].robot.joints.index(str(where))
    if kind.id == 'joint_torque_ripple':
        most = max(float(np.ptp(b.motion.q[:, j])) for b in balances)
        return [{'harmonic': p} for p in _PER_TURN if p * most > math.pi]
    if kind.id in ('joint_stribeck_friction', 'joint_friction_curvature'):
        speed = np.abs(np.concatenate([b.motion.qd[:, j] for b in balances]))
        fast = max(float(np.quantile(speed, 0.95)), 1e-2)
        is_curve = kind.id == 'joint_friction_curvature'
        return [{'rate': fast} if is_curve else {'velocity': max(_STRIBECK * fast, 3e-3)}]
    if kind.id == 'joint_coupled_friction':
        variants = kind.variants(balances[0].robot, where)
        return [v for v in variants if _is_coupled(j, v['ratio'], balances)]
    if kind.id == 'joint_presliding_friction':
        least, most = _displacements(j, balances)  # without a motor what is left is of the motion
        own = [d for d in _DISPLACEMENTS if least < d < most]
        return [{'displacement': d} for d in own] * (where not in balances[0].robot.passive_joints)
    if kind.id == 'joint_stiffness':
        return [{'rest_angle': float(np.mean([np.mean(b.motion.q[:, j]) for b in balances]))}]
    return [{}]


def _is_coupled(j: int, ratio: float, balances: Sequence[Balance]) -> bool:
    """Whether friction of u = q_j' + r q_k' is ever anything but friction of q_j' and of q_k'.

    Where they always move in the same proportion it has, on each of the two joints, the sign of
    that joint's own rate throughout, or the other one.
    """
    robot = balances[0].robot
    k = robot.bodies[1 + j].parent - 1
    if k < 0:
        return False
    for b in balances:
        rates = b.motion.qd[b.arm.is_moving[:, [j, k]].all(axis=1)][:, [j, k]]
        both = rates @ [1.0, ratio]
        for own, share in zip(rates.T, (1.0, ratio), strict=True):
            sign = np.sign(own * share * both) * (np.abs(both) > _CLEARLY * np.abs(own))
            least = _TOGETHER * len(b.motion.qd)
            if min(np.sum(sign > 0.0), np.sum(sign < 0.0)) > least:
                return True
    return False


def _displacements(j: int, balances: Sequence[Balance]) -> tuple[float, float]:
    """Smallest and largest displacement that the motion of a joint shows [rad].

    A reversal with acceleration a covers a t^2 / 2 before and after it in time t: what builds up
    within the time of the band is dry friction that is late, as by a delay.
    """
    bends = np.concatenate([b.arm.kinematics.qdd[b.arm.is_moving[:, j], j] for b in balances])
    time = 1.0 / (2.0 * math.pi * min(b.arm.band for b in balances))
    bend = math.sqrt(float(np.mean(bends**2))) if len(bends) else math.inf
    most = max(float(np.ptp(b.motion.q[:, j])) for b in balances)
    return bend * time**2, most / _REVERSALS
