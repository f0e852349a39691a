"""How much an arm's model leaves of each joint's torque, whether that is usual; in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.effect import Effect, Key
from ...effects.prior import RUN_TO_RUN
from ...estimation.balance.arm_priors import torque_tolerance
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance, own_noise_in_band
from ...inference.decisive import IMPLAUSIBLE
from ...inference.inferred import InferredCause
from ...model.robot import Robot
from ...types import Array, BoolArray, IntArray
from ..answer.cause import Cause
from ..answer.result import Leftover
from ..answer.words import at, cause_in_words, first_few
from ..limits import CLEAR, FULL_SCALE, LIKE_NOISE, RELEVANT
from .arm_found import ArmFound


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """What a model leaves of the torques.

    Args:
        robot: Its robot.
        before: (n,) rms by the model as it stands; nan of a joint that never moves [N m].
        after: (n,) by the extended model [N m].
        usual: (n,) what any machine differs from its file by, and the noise of its sensors [N m].
        scale: (n,) `ArmRows.judged_by` [N m].
    """

    robot: Robot
    before: Array
    after: Array
    usual: Array
    scale: Array

    @classmethod
    def of(cls, found: ArmFound) -> Left:
        """Of an arm's causes."""
        before, after = (traces.rms for traces in found.traces)
        return cls(found.robot, before, after, _usual(found), found.fit.rows.judged_by)

    @property
    def unusual(self) -> list[int]:
        """Joints of which more is left."""
        return np.flatnonzero(self.after > self.usual).tolist()

    def matters(self, entry: Leftover) -> bool:
        """Whether a channel's leftover has a law.

        One that is not applied must be clear of its own deviations, and of enough.
        """
        if entry.form is None or entry.applied is not None:
            return entry.form is not None
        if not any(abs(c.value) > CLEAR * c.std for c in entry.coefficients):
            return False
        j = self.robot.joints.index(entry.channel.rpartition('/')[2])
        return bool(self.after[j] > RELEVANT * self.scale[j])

    def in_words(self) -> str:
        """Root mean square over the joints that move, torques and forces apart."""
        return ' and '.join(
            f'{overall(self.after[of]):.3g} of {overall(self.before[of]):.3g} {unit} (rms)'
            for unit, of in self._by_unit()
        )

    def after_in_words(self) -> str:
        """The same of the extended model alone."""
        left = (f'{overall(self.after[of]):.3g} {unit}' for unit, of in self._by_unit())
        return ' and '.join(left) + ' (rms)'

    def unusual_in_words(self) -> str:
        """The joints of which more is left than usual."""
        names, units = self.robot.joints, self._units()
        at = sorted(self.unusual, key=lambda j: -self.after[j] / self.usual[j])
        return first_few(
            [f'{names[j]}: {self.after[j]:.3g} of {self.before[j]:.3g} {units[j]}' for j in at]
        )

    def _units(self) -> list[str]:
        return [self.robot.unit_of('N m', joint) for joint in self.robot.joints]

    def _by_unit(self) -> Iterator[tuple[str, BoolArray]]:
        """Units with (n,) the joints that have them and move."""
        units, moves = np.array(self._units()), np.isfinite(self.after)
        for unit in dict.fromkeys(units[moves].tolist()):
            yield unit, moves & (units == unit)


def laws_that_matter(found: ArmFound, left: Left, leftover: Sequence[Leftover]) -> list[Leftover]:
    """Laws of what is left that decide a verdict: as causes, from `RELEVANT` of the torque on."""
    out = []
    for entry in leftover:
        applied = entry.applied
        if left.matters(entry) and (applied is None or _share(found, applied) > RELEVANT):
            out.append(entry)
    return out


def doubts(named: Iterable[tuple[InferredCause, Key]]) -> Iterator[str]:
    """What is named, effect and place, and larger than plausible."""
    for cause, (effect, where) in named:
        if cause.slabs > IMPLAUSIBLE:
            yield (
                f'{effect}{at(where)} is {cause.slabs:.2g} times as large as is plausible there: '
                'it may stand for something else'
            )


def _share(found: ArmFound, law: Effect) -> float:
    """Rms of a law's torque by `ArmRows.judged_by` of its joint, where that moves."""
    j, total, count = found.robot.joints.index(str(law.where)), 0.0, 0
    for balance in found.extended:
        moving = balance.arm.is_moving[:, j]
        torque = law.force(balance.motion, law.driven(balance.motion))[moving, 6 + j]
        total, count = total + float(torque @ torque), count + len(torque)
    return math.sqrt(total / max(count, 1)) / float(found.fit.rows.judged_by[j])


def sentence(
    verdict: str, named: Sequence[Cause], left: Left, *, has_unclear: bool = False
) -> str:
    """The verdict as a test engineer would say it: the three causes that matter, and the rest.

    Args:
        verdict: The word.
        named: What is named.
        left: What is left.
        has_unclear: Whether something else predicts and is not clear enough for a name.
    """
    if verdict == 'consistent':
        return f'The model explains the data up to {left.after_in_words()}.'
    beyond = f', more than usual at {left.unusual_in_words()}' if left.unusual else ''
    if not named:
        words = f'{left.in_words()} is left{beyond}'
        does = 'clearly does' if has_unclear else 'does'
        return f'The model does not explain the data ({words}), and no known effect {does}.'
    what = first_few([cause_in_words(cause, is_short=True) for cause in named])
    rest = f'remains unexplained{beyond}' if beyond else 'is left, no more than usual'
    return f'The data differ from the model by {what}. {left.in_words()} {rest}.'


def overall(values: Array) -> float:
    """Root mean square of those that are known."""
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else math.nan


def _usual(found: ArmFound) -> Array:
    """(n,) that any machine differs from its file by, and what its sensors say too much."""
    rows, deviations = found.fit.rows, found.fit.rows.tolerances.copy()
    for i, candidate in enumerate(rows.candidates):
        at = rows.places[i]
        if candidate.kind.id == 'joint_torque_constant':  # below, with friction that is named, too
            deviations[at] = 0.0
        elif i in found.fit.chosen and candidate.kind.id.endswith('_friction'):
            deviations[at] = np.hypot(deviations[at], RUN_TO_RUN * found.fit.values[at])
    gain = torque_tolerance(found.robot) * rows.scale
    noise = np.sqrt(np.mean([own_noise_in_band(b) ** 2 for b in found.extended], axis=0))
    scale = FULL_SCALE * full_scale(found.robot, found.extended)
    parts = (_torque_of(rows, deviations), gain, LIKE_NOISE * noise, scale)
    return np.asarray(np.linalg.norm(parts, axis=0))


def _torque_of(rows: ArmRows, deviations: Array) -> Array:
    """(n,) standard deviation of the torques of coefficients (K,) like these [N m].

    What bodies are off by goes together as their spikes say. Root mean square over the rows where
    a joint moves; NaN of one that never does.
    """
    deviations, roots = deviations.copy(), list[tuple[IntArray, Array]]()
    for candidate, own in zip(rows.candidates, rows.places, strict=True):
        if candidate.prior is not None and candidate.prior.spike.ndim > 1:
            values, vectors = np.linalg.eigh(candidate.prior.spike)
            roots.append((own, vectors * np.sqrt(np.maximum(values, 0.0))))
            deviations[own] = 0.0
    out = []
    for joint in rows.joints[: rows.robot.n_joints]:
        power = np.sum((joint.columns * deviations) ** 2, axis=1)
        for own, root in roots:
            power += np.sum((joint.columns[:, own] @ root) ** 2, axis=1)
        out.append(math.sqrt(np.mean(power)) if len(power) else math.nan)
    return np.array(out)


def full_scale(robot: Robot, balances: Sequence[Balance]) -> Array:
    """(n,) largest torque that each joint's motor is made to measure [N m].

    Its limit in the URDF, but no more than the arm's largest torque of that unit, since limits are
    often made up; where there is none, its own largest torque.
    """
    efforts = [np.max(np.abs(balance.arm.effort), axis=0) for balance in balances]
    own = np.max(efforts, axis=0)
    slides = np.array([body.is_prismatic for body in robot.bodies[1:]])
    most = np.where(slides, np.max(own * slides), np.max(own * ~slides))
    limits = robot.effort_limits
    return np.where(np.isfinite(limits), np.maximum(own, np.minimum(limits, most)), own)
