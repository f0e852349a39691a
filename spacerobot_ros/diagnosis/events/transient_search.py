"""All transients of some recordings: one search over every way to make templates.

The largest first: what stands out of all that was found joins it, at the times of the largest
likelihood, and the level of what is left is found again, until nothing more stands out. What does
not stand beside all others goes, and what covers two gives way to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...types import Array
from ..limits import LISTED, QUIET, SCATTERED
from .matched import Filtered, MatchedFilter, Templates
from .naming_rule import as_rare
from .transient import Shapes, Transient, apart

_MOST = 20  # rounds; transients where the noise is known
_ZOOMS, _ZOOM = 2, 4.0
_PASSES, _HALVINGS = 8, 3
_SETTLED = 0.05  # less of the cost is settled
_FARTHEST = 0.5  # durations that a transient moves at once, and of their logarithm
_STEP = 0.02  # of a duration, for derivatives
_SHIFTS, _FACTORS = np.linspace(-0.5, 0.5, 9), np.linspace(-1.0, 1.0, 7)
_USUAL, _WIDTH = 0.5, 1.3  # s, and deviation of its logarithm: most last 0.04 to 6 s
_CLEAR = 4.0  # deviations in white noise, beyond which a scatter is none of it
_TOUCHING = 0.1  # s between two that are one
_SPACING = 0.5  # s between the pairs that are tried, and their duration
_LAGS = np.linspace(-2.0, 2.0, 13)  # durations, and powers of two of durations
_COARSE, _FINEST = 1.0, 1e-3  # of a duration: deviations that a grid is too coarse for


class TransientSearch:
    """All transients of some recordings.

    Args:
        templates: The recordings.
        least: z by the scatter of what is left from which something is sought.
        start: What is known.

    Attributes:
        templates: At the level beside what was found.
        found: The largest first; covariances and z by the scatter of what is left.
    """

    def __init__(
        self, templates: Templates, least: float = LISTED, start: Sequence[Transient] = ()
    ) -> None:
        self.templates = templates
        self._colours: dict[tuple[int, float], float] = {}
        self._stds: dict[tuple[int, float], Array] = {}
        raw = [*start]
        for _ in range(_MOST):
            fresh = self._peaks(raw, least)
            if not fresh or (self.templates.shows and len(raw) >= _MOST):
                break
            known, raw = raw, self._refined(raw, fresh)
            self.templates = self.templates.about(raw)
            if len(raw) <= len(known):
                break
        raw = self._standing(raw)
        is_few = len(raw) < _MOST // 2  # what changes all the time is no two steps either
        if self.templates.shows and (self.is_steady or is_few):
            raw = self._split(raw)
            self._peaks(raw, least)
            raw = self._standing(raw)
        self.raw = raw
        self._peaks(raw, least)
        self.found = sorted(map(self._scaled, raw), key=lambda p: -p.z)

    def colour(self, joint: int, duration: float) -> float:
        """By how much z scatters more than in white noise."""
        durations = self.templates.durations
        near = min(durations, key=lambda d: float(abs(np.log(d / duration))))
        return self._colours.get((joint, near), 1.0)

    @property
    def is_steady(self) -> bool:
        """Whether what is left is noise, beside which what stands out is not all there is."""
        return max(self._colours.values(), default=1.0) <= SCATTERED

    def usual_std(self, joint: int, duration: float) -> Array:
        """(k,) usual standard deviation of a bell of one of the durations; inf: unseen."""
        return np.asarray(self._stds[joint, duration] * self._colours[joint, duration])

    def without(self, some: Sequence[Transient]) -> list[Transient]:
        """All of `raw` but some."""
        keys = {(p.joint, p.run, p.start) for p in some}
        return [q for q in self.raw if (q.joint, q.run, q.start) not in keys]

    def middle_std(self, p: Transient) -> float:
        """Standard deviation of a middle [s], over all times that are nearly as likely.

        Two bells of other lengths may do as well as one another, so that curvature is too little.
        Starts and ends are likely alike at all times.
        """
        beside = self._beside(self.without([p]))
        scale, std = 1.0, 0.0
        while std < _COARSE * scale * p.duration and scale > _FINEST:
            shapes = self._about(p, scale * _LAGS, scale * _LAGS, (p.edge,))
            z = beside.test(p.joint, p.run, shapes).z / self.colour(p.joint, p.duration)
            weights = shapes.duration**2 * np.exp(0.5 * (z**2 - np.max(z) ** 2)) * (z > 0.0)
            off = shapes.centre - p.middle
            std = float(np.sqrt(np.sum(weights * off**2) / np.sum(weights)))
            scale /= _ZOOM
        return std

    def _scaled(self, p: Transient) -> Transient:
        colour = self.colour(p.joint, p.duration)
        return replace(p, covariance=colour**2 * p.covariance, z=p.z / colour)

    def _size(self, p: Transient) -> float:
        return p.z / self.colour(p.joint, p.duration)

    def _peaks(self, found: Sequence[Transient], least: float) -> list[Transient]:
        """What stands out most beside what was found, at its place and times."""
        beside = self._beside(found)
        every = (self._of(joint, found, beside, least) for joint in self.templates.joints)
        return [p for own in every for p in own]

    def _of(
        self, joint: int, found: Sequence[Transient], beside: MatchedFilter, least: float
    ) -> list[Transient]:
        seen = []
        own = [q for q in found if q.joint == joint]
        for duration in self.templates.durations:
            tried = []
            for run in range(self.templates.runs):
                shapes = self.templates.bells(run, duration)
                f, there = beside.test(joint, run, shapes), shapes.centre
                near = [q for q in own if q.run == run]
                for q in near:
                    f.z[(there > q.start - _TOUCHING) & (there < q.end + _TOUCHING)] = 0.0
                tried.append((run, shapes, f))
            self._learn(joint, duration, [f for _, _, f in tried])
            colour = 1.0 if self.templates.shows else self._colours[joint, duration]
            least_z = colour * as_rare(least, tried[0][2].value.shape[1])
            seen += [
                _transient(joint, run, shapes, f, int(k))
                for run, shapes, f in tried
                for k in np.flatnonzero(f.z >= least_z)
            ]
        taken: list[Transient] = []
        for p in sorted(seen, key=lambda p: -self._size(p)):
            is_known = any(p.overlaps(q) for q in own)
            if not (is_known or any(p.overlaps(q, self.templates.shows) for q in taken)):
                taken.append(p)
        return taken

    def _learn(self, joint: int, duration: float, found: Sequence[Filtered]) -> None:
        """How much z scatters, and how well a bell is usually known."""
        z = np.concatenate([f.z for f in found])
        mean, std = self.templates.white(duration)
        beyond = float(np.log(np.quantile(z[z > 0.0], QUIET))) - mean if np.any(z) else 0.0
        self._colours[joint, duration] = float(np.exp(beyond)) if beyond > _CLEAR * std else 1.0
        covariance = np.concatenate([f.covariance[f.z > 0.0] for f in found])
        stds = np.sqrt(np.diagonal(covariance, 0, 1, 2))
        self._stds[joint, duration] = _usual(stds)

    def _beside(self, found: Sequence[Transient]) -> MatchedFilter:
        return MatchedFilter(self.templates, found)

    def _refined(
        self, found: Sequence[Transient], fresh: Sequence[Transient] = ()
    ) -> list[Transient]:
        """Times of all fitted together, sizes free beside them, some of them by a grid before.

        Variable projection by Gauss and Newton (Golub and Pereyra, Inverse Problems 19 (2003)).
        """
        every = [*found, *fresh]
        for p in sorted(fresh, key=lambda p: -p.z):
            others = [q for q in every if q is not p]
            every = [*others, self._best(p, self._beside(others))]
        every = apart(every, _TOUCHING)
        cost = self._cost(every)
        for _ in range(_PASSES if every else 0):
            step = self._step(every)
            for k in range(_HALVINGS):
                trial = [self._moved(p, *own) for p, own in zip(every, 0.5**k * step, strict=True)]
                if (now := self._cost(trial)) < cost:
                    break
            else:
                break
            gained, every, cost = cost - now, trial, now
            if gained < _SETTLED:
                break
        return apart(every, _TOUCHING)

    def _cost(self, found: Sequence[Transient]) -> float:
        """Minus twice the log posterior, but for a constant."""
        beyond = (np.log([p.duration for p in found]) - np.log(_USUAL)) / _WIDTH
        return float(np.sum(beyond**2)) - self._beside(found).projection.gain

    def _step(self, found: Sequence[Transient]) -> Array:
        """(M, 2) towards the best middles, in durations, and logarithms of durations."""
        beside, changes = self._beside(found), []
        for p, value in zip(found, beside.values, strict=True):
            for way in ((_STEP, 0.0), (0.0, _STEP)):
                ends = (self._moved(p, sign * way[0], sign * way[1]) for sign in (1.0, -1.0))
                after, before = map(self.templates.column, ends)
                changes.append((after - before) @ value / (2.0 * _STEP))
        columns = beside.left(np.column_stack(changes))
        left = self.templates.data - beside.made(beside.projection.coefficients)
        durations = np.array([p.duration for p in found])
        beyond = np.column_stack([0.0 * durations, np.log(durations / _USUAL) / _WIDTH**2])
        prior = np.tile([1.0, _WIDTH**-2.0], len(found))
        normal = columns.T @ columns + np.diag(prior)
        step = np.linalg.solve(normal, columns.T @ left - beyond.ravel())
        return np.clip(step, -_FARTHEST, _FARTHEST).reshape(-1, 2)

    def _moved(self, p: Transient, later: float, longer: float) -> Transient:
        middle = p.middle + later * p.duration
        half = 0.5 * float(np.clip(p.duration * np.exp(longer), *self.templates.bounds))
        return replace(p, start=middle - half, end=middle + half)

    def _best(self, p: Transient, beside: MatchedFilter) -> Transient:
        """A transient where its likelihood is largest, on a grid."""
        best, before, scale = p, -np.inf, 1.0
        for _ in range(_ZOOMS):
            shapes = self._about(best, scale * _SHIFTS, scale * _FACTORS, self.templates.edges)
            found = beside.test(p.joint, p.run, shapes)
            score = found.z**2 - (np.log(shapes.duration / _USUAL) / _WIDTH) ** 2
            score[found.z == 0.0] = -np.inf
            at = int(np.argmax(score))
            if score[at] < before + _SETTLED:
                break
            best, before = _transient(p.joint, p.run, shapes, found, at), score[at]
            scale /= _ZOOM
        return best

    def _about(
        self, p: Transient, shifts: Array, factors: Array, edges: Sequence[float]
    ) -> Shapes:
        """Pulses at middles off by shares of a duration, of durations that are powers of two."""
        durations = np.clip(p.duration * 2.0**factors, *self.templates.bounds)
        grid = np.meshgrid(p.middle + shifts * p.duration, np.unique(durations), edges)
        return Shapes(*(x.ravel() for x in grid))

    def _standing(self, found: list[Transient]) -> list[Transient]:
        """Without what does not stand beside all others, at their times.

        The weakest first: what it takes is its neighbours', whose times it held.
        """
        while True:
            found = [self._sized(p, found) for p in found]
            falls: list[Transient] = []
            for p in sorted(found, key=self._size):
                near = any(p.overlaps(q, self.templates.shows) for q in falls)
                if self._size(p) < LISTED and not near:
                    falls.append(p)
            if not falls:
                return found
            if self.templates.shows and not self.is_steady:
                return [p for p in found if self._size(p) >= LISTED]
            found = self._refined([p for p in found if p not in falls])
            self.templates = self.templates.about(found)

    def _sized(self, p: Transient, found: Sequence[Transient]) -> Transient:
        """Beside all others."""
        beside = self._beside([q for q in found if q is not p])
        shapes = Shapes.of(p)
        return _transient(p.joint, p.run, shapes, beside.test(p.joint, p.run, shapes), 0)

    def _split(self, found: list[Transient]) -> list[Transient]:
        """Two in place of one that covers both, or lies between, where they explain more.

        One between two is a valley of its own: no step leads out of it.
        """
        for p in found:
            others = [q for q in found if q is not p]
            pair = self._pair(p, others)
            trial = self._refined(others, pair)
            gained = self._cost(found) - self._cost(trial)
            is_more = len(trial) > len(found) and gained > LISTED**2
            if is_more and min(self._sized(q, trial).z for q in trial) > LISTED:
                return self._split(trial)
        return found

    def _pair(self, p: Transient, others: Sequence[Transient]) -> list[Transient]:
        """The best two of all pairs of usual length about a transient."""
        reach = self.templates.bounds[1]
        shapes = Shapes.bells(p.middle + np.arange(-reach, reach + _SPACING, _SPACING), _SPACING)
        found = self._beside(others).test(p.joint, p.run, shapes)
        every = [_transient(p.joint, p.run, shapes, found, k) for k in range(len(shapes))]
        every = [q for q in every if q.z and not any(q.overlaps(o) for o in others)]
        best, most = [p], -np.inf
        for one in every:
            beside = self._beside([*others, one])
            z = beside.test(p.joint, p.run, Shapes.of(*every)).z
            z[[q.overlaps(one, _TOUCHING) for q in every]] = 0.0
            gain = beside.projection.gain + np.max(z) ** 2
            if np.any(z) and gain > most:
                best, most = [one, every[int(np.argmax(z))]], gain
        return best


def _transient(joint: int, run: int, shapes: Shapes, found: Filtered, k: int) -> Transient:
    start, end, edge = (float(x[k]) for x in (shapes.start, shapes.end, shapes.edge))
    return Transient(
        joint, run, start, end, edge, found.value[k], found.covariance[k], float(found.z[k])
    )


def _usual(stds: Array) -> Array:
    """(k,) of (M, k) standard deviations: that of most, or near that of nearly all."""
    if not len(stds):
        return np.full(stds.shape[1], np.inf)
    return np.maximum(np.median(stds, axis=0), 0.6 * np.quantile(stds, 0.95, axis=0))
