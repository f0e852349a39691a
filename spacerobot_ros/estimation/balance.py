r"""The balance of torques along a measured motion, in the band where effects act.

    H(q) q'' + c(q, q') - tau = sum of c_k f_k + inertial errors + what no effect explains

Discrete cosine terms below `BAND` of the left side are the data. Nothing is integrated, so a model
that is wrong everywhere is as good a start as any: this is for data whose noise nobody knows
(`inadequacy.py`). The level of what no effect explains comes from the data: what inertial errors
and the whole catalogue together leave, with what so large a fit takes from pure noise allowed for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.fft import dct, idct

from ..diagnosis.search import Judged
from ..effects.effect import Effect
from ..effects.motion import Motion
from ..types import Array, IntArray
from .columns import Candidate, candidates
from .evidence import Gram, score
from .reference import Kinematics
from .refit import Run
from .response import InverseDynamics, Response
from .torque_process import TorqueDriven

BAND = 4.0  # Hz
_TRAIN_SHARE = 0.6  # of the record, to fit on
_PASSES = 4
_LEAST = 1e-3  # of an effort's spread: no torque sensor is as good


def band_terms(values: Array, times: Array) -> Array:
    """(C, ...) discrete cosine terms of values (N, ...) below `BAND`, of unit norm each."""
    return np.asarray(dct(values, axis=0, norm='ortho')[: _count(times)])


def band_limited(values: Array, times: Array) -> Array:
    """(N, ...) values without what is faster than `BAND`."""
    terms = dct(values, axis=0, norm='ortho')
    terms[_count(times) :] = 0.0
    return np.asarray(idct(terms, axis=0, norm='ortho'))


def _count(times: Array) -> int:
    return max(4, int(2.0 * BAND * (times[-1] - times[0])))


def missed_torque(run: Run, causes: Sequence[Effect] = ()) -> tuple[Array, Array]:
    """Times (N,) and torques (N, n) that a model needs beyond those measured.

    Args:
        run: The run.
        causes: Effects that the model has beside the robot file's.
    """
    measured = run.measured(causes)
    process = TorqueDriven(run.robot, (*run.believed, *causes))
    times = measured.time_base.times
    motion = process.motion(measured.kinematics, measured.reference.effort(times))
    return times, -process.force_error(motion)[:, 6:]


class TorqueBalance:
    """What a model misses, and what every effect would add to it.

    Args:
        run: The run.
        effects: The catalogue.
    """

    def __init__(self, run: Run, effects: Sequence[type[Effect]]) -> None:
        filtered = run.innovations(())
        self._filter = filtered
        self.robot = filtered.process.robot
        self.pool = candidates(_of_the_joints(effects), filtered, filtered.data)
        self.times = filtered.time_base.times
        ends = np.cumsum([len(c.steps) for c in self.pool])
        self._place = {
            id(c): np.arange(end - len(c.steps), end)
            for c, end in zip(self.pool, ends, strict=True)
        }
        self._sizes = np.concatenate([c.sizes for c in self.pool])
        split = int(np.searchsorted(self.times, _share(self.times)))
        parts = (slice(0, split), slice(split, len(self.times)))
        missed = -filtered.process.force_error(filtered.motion)[:, 6:]
        columns = np.concatenate([self._columns(c) for c in self.pool], axis=2)
        self._missed = [band_terms(missed[part], self.times[part]) for part in parts]
        self._effects = [band_terms(columns[part], self.times[part]) for part in parts]
        self.levels = self._unexplained()

    @property
    def unexplained(self) -> Array:
        """(n,) root mean square of the torque that is taken for noise, in the band [N m]."""
        return np.asarray(self.levels * np.sqrt(_count(self.times) / len(self.times)))

    @cached_property
    def grams(self) -> tuple[Gram, Gram]:
        """Of the first part of the record and of the rest, weighted by what is unexplained."""
        train, test = (
            Gram.of(
                (columns / self.levels[:, None]).reshape(-1, columns.shape[2]),
                (missed / self.levels).ravel(),
            )
            for columns, missed in zip(self._effects, self._missed, strict=True)
        )
        return train, test

    def judge(self, causes: Sequence[Judged]) -> list[Judged]:
        """Every candidate beside causes and inertial errors, best evidence first.

        Of each effect at each place only its best variant is kept.
        """
        chosen = {c.candidate.key for c in causes}
        judged = [self._judged(c, causes) for c in self.pool if c.key not in chosen]
        judged.sort(key=lambda j: -j.score.evidence)
        best = {j.candidate.key: j for j in reversed(judged)}
        return sorted(best.values(), key=lambda j: -j.score.evidence)

    def estimate(self, causes: Sequence[Judged], parts: Sequence[Gram]) -> tuple[Array, Array]:
        """Coefficients of the causes beside each other, and their covariance.

        Args:
            causes: K coefficients in all.
            parts: Of `grams`.

        Returns:
            (K,) and (K, K), in the order of the causes.
        """
        held = np.unique(np.concatenate([self._place[id(c.candidate)] for c in causes]))
        information = sum((g.part(held).matrix for g in parts), np.diag(self._sizes[held] ** -2.0))
        covariance = np.linalg.pinv(information, hermitian=True)
        values = covariance @ sum(g.vector[held] for g in parts)
        own = np.concatenate([self._place[id(c.candidate)] for c in causes])
        at = np.searchsorted(held, own)
        return np.asarray(values[at]), np.asarray(covariance[np.ix_(at, at)])

    def error(self, causes: Sequence[Judged], values: Array, gram: Gram) -> float:
        """Root mean square of what causes leave of a part, by the level of the unexplained."""
        square = gram.square
        if causes:
            own = np.concatenate([self._place[id(c.candidate)] for c in causes])
            part = gram.part(own)
            square += float(values @ part.matrix @ values - 2.0 * part.vector @ values)
        return float(np.sqrt(max(square, 0.0) / gram.rows))

    def _judged(self, candidate: Candidate, causes: Sequence[Judged]) -> Judged:
        own = self._place[id(candidate)]
        held = np.setdiff1d(self._held(causes), own)
        precision = self._sizes[held] ** -2.0
        train, test = (
            g.part(np.concatenate([held, own])).without(len(held), precision) for g in self.grams
        )
        bounds = (candidate.lower, candidate.upper)
        return Judged(candidate, score(train, candidate.sizes, bounds, test))

    def _held(self, causes: Sequence[Judged]) -> IntArray:
        """Columns of inertial errors and causes."""
        inertial = [self._place[id(c)] for c in self.pool if c.kind.id == 'inertial_parameters']
        own = [self._place[id(c.candidate)] for c in causes]
        return np.unique(np.concatenate([np.zeros(0, dtype=int), *inertial, *own]))

    def _columns(self, candidate: Candidate) -> Array:
        """(N, n, K) missed torque by each coefficient."""
        return np.stack(
            [
                self._missing(candidate.applied(direction)) / step
                for direction, step in zip(candidate.directions, candidate.steps, strict=True)
            ],
            axis=2,
        )

    def _missing(self, applied: Effect) -> Array:
        """(N, n) torque that the model misses by an effect.

        What scales measured torques is taken to scale those that the model needs: else a gain of
        zero and no masses would explain everything.
        """
        motion = self._motion
        force = self._response.force(applied)[:, 6:]
        force += motion.effort - applied.sense('joint_effort', motion.effort, motion)
        late = applied.delay('joints') + applied.delay('effort')
        if late:
            force += late * self._filter.reference.effort(motion.time, 1)
        return force + self._misread(applied) if applied.acts('sense') else force

    def _misread(self, applied: Effect) -> Array:
        """(N, n) torque that inverse dynamics add where positions are read wrongly."""
        at: Kinematics = self._filter.kinematics
        error = applied.sense('joint_position', at.q, self._motion) - at.q
        if not error.any():
            return error
        slope = np.gradient(error, at.time, axis=0)
        bend = np.gradient(slope, at.time, axis=0)
        read = Kinematics(
            at.time, at.q + error, at.qd + slope, at.omega, at.rotation, at.qdd + bend, at.alpha
        )
        motion = self._inverse.motion(read, self._motion.effort)
        return self._inverse(motion)[:, 6:] - self._motion.effort

    @cached_property
    def _inverse(self) -> InverseDynamics:
        return InverseDynamics(self._filter.process.robot)

    @cached_property
    def _motion(self) -> Motion:
        """The motion with the torques that the model needs for it."""
        needed = self._inverse(self._filter.motion)[:, 6:]
        return self._inverse.motion(self._filter.kinematics, needed)

    @cached_property
    def _response(self) -> Response:
        return Response(self._filter.process.robot, self._motion)

    def _unexplained(self) -> Array:
        """(n,) level of one term of what all effects together leave."""
        missed = np.concatenate(self._missed)
        columns = np.concatenate(self._effects) * self._sizes
        effort = self._filter.record.effort
        least = _LEAST * np.std(effort, axis=0) if effort is not None else 0.0
        levels = np.maximum(np.sqrt(np.mean(missed**2, axis=0)), least)
        for _ in range(_PASSES):
            levels = np.maximum(_left(columns, missed, levels), least)
        return np.asarray(levels)


def _of_the_joints(effects: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Effects without states of their own: what swings by itself looks like anything here."""
    return [effect for effect in effects if not effect.hidden]


def _share(times: Array) -> float:
    return float(times[0] + _TRAIN_SHARE * (times[-1] - times[0]))


def _left(columns: Array, missed: Array, levels: Array) -> Array:
    """(n,) levels of what a fit leaves of (C, n) torques, weighted by levels (n,)."""
    count, n, width = columns.shape
    design = (columns / levels[:, None]).reshape(count * n, width)
    basis, strengths, _ = np.linalg.svd(design, full_matrices=False)
    kept = strengths**2 / (1.0 + strengths**2)
    data = (missed / levels).ravel()
    rest = (data - basis @ (kept * (basis.T @ data))).reshape(count, n)
    used = (basis**2 @ kept).reshape(count, n)
    free = np.maximum(np.sum(1.0 - used, axis=0), 1.0)
    return np.asarray(levels * np.sqrt(np.sum(rest**2, axis=0) / free))
