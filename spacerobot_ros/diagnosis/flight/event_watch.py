r"""Events in flight: a torque from outside on joints or base, by the newest innovations.

In each of the W newest parts of the flight a torque of its own may have acted, with whitened
columns C. For one that began i parts ago and acts still, the columns of those parts add up, and

    z_j = c_j' r / |c_j|  on joint j,    z^2 = g' G^-1 g,  g = c' r, G = c' c (3 x 3)  on the base.

As in recordings (docs/events.md) what the model always leaves is no event: z counts by its usual
scatter, and from `EVENT` on. What an error of one sensor explains better is none either.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..events.event import Event
from ..events.matched import Projection
from ..events.naming_rule import quiet_size
from ..events.transient import BASE, Transient, event_of
from ..limits import EVENT, LISTED, QUIET
from .block_innovations import Block
from .probes import Probe

_HISTORY, _FEWEST = 300, 20  # parts by which the usual scatter is known
_NOW, _QUIET = 2, 0.5  # newest parts without a torque, for as long [s]: an event is over
_SHAPE = 1.0 / 3.0  # of a bell's square that a constant torque leaves: no sign of other torques
_LEAST = 1e-6  # of a sensor's square, below which its error is not seen
_HELD = 1e-6  # of its duration: a torque that is constant rises at once


@dataclass(frozen=True, slots=True)
class _Part:
    start: float
    end: float
    data: Array
    pulses: Array
    sensors: Array


class EventWatch:
    """Looks at the newest parts of a flight.

    Args:
        robot: The robot.
        probes: Ways in which its model may fail, sensors among them.
        kept: Number of parts in which an event may have begun.

    Attributes:
        event: The last one; None: there was none.
        count: Number of them.
    """

    def __init__(self, robot: Robot, probes: Sequence[Probe], kept: int) -> None:
        self._robot = robot
        self._sensors = [k for k, probe in enumerate(probes) if probe.driven is None]
        self._base = 3 if robot.is_free else 0
        self._names = [*'xyz'[: self._base], *robot.joints]
        self._parts: deque[_Part] = deque(maxlen=kept)
        self._usual: deque[Array] = deque(maxlen=_HISTORY)
        self.event: Event | None = None
        self.count = 0

    def interrupt(self) -> None:
        """The flight is not judged for a while; an event that went on is over."""
        self._parts.clear()
        self._end()

    def add(self, block: Block, start: float, end: float) -> None:
        """Take the newest part, from start to end [s]."""
        if not len(block.data):
            return
        sensors = np.hstack([x[:, self._sensors] for x in (block.lasting, block.sudden)])
        self._parts.appendleft(_Part(start, end, block.data, block.pulses, sensors))
        information, vector = self._sums()
        z = self._sizes(information, vector)
        colour = self._colour()
        self._usual.append(z)
        if colour is None:
            return
        raw, z = z, np.nan_to_num(z / colour)
        age, axis = np.unravel_index(int(np.argmax(z)), z.shape)
        if self._is_ongoing:
            if np.max(z[:_NOW]) < LISTED:
                if end - self.event_end > _QUIET:
                    self._end()
                return
        elif np.max(z) < EVENT or self._sensor_gain() > raw[age, axis] ** 2:
            return
        square, part = self._since(int(age), information, vector)
        found = self._described(int(age), square, part, colour[age], float(np.max(z)))
        if self._is_ongoing and self.event is not None:
            best = max(found, self.event, key=lambda event: event.z)
            found = replace(best, start=min(found.start, self.event.start), end=end)
        else:
            self.count += 1
        self.event = found

    @property
    def event_end(self) -> float:
        """End of the last event so far [s]."""
        return -np.inf if self.event is None else self.event.end

    @property
    def _is_ongoing(self) -> bool:
        return self.event is not None and self.event.ongoing

    def _end(self) -> None:
        if self.event is not None and self.event.ongoing:
            self.event = replace(self.event, ongoing=False)

    def _sums(self) -> tuple[Array, Array]:
        """C'C (W, m, W, m) and C'r (W, m) of all parts, by the age of a torque's own part."""
        count, axes = len(self._parts), len(self._names)
        information, vector = np.zeros((count, axes, count, axes)), np.zeros((count, axes))
        for age, part in enumerate(self._parts):
            own = part.pulses[:, : count - age]
            information[age:, :, age:] += np.einsum('ria,rjb->iajb', own, own)
            vector[age:] += np.einsum('ria,r->ia', own, part.data)
        return information, vector

    def _since(self, age: int, information: Array, vector: Array) -> tuple[Array, Array]:
        """(m, m) and (m,) of torques that act since so many parts."""
        last = slice(age + 1)
        return information[last, :, last].sum(axis=(0, 2)), vector[last].sum(axis=0)

    def _sizes(self, information: Array, vector: Array) -> Array:
        """(W, 1 + n) size of a torque on the base (0 where it is fixed) and on each joint.

        Ages that have not been seen yet have nan.
        """
        b = self._base
        out = np.full((self._parts.maxlen or 0, 1 + len(self._names) - b), np.nan)
        for age in range(len(self._parts)):
            square, part = self._since(age, information, vector)
            own = np.diag(square)
            out[age, 1:] = np.abs(part[b:]) / np.sqrt(np.where(own[b:] > 0.0, own[b:], np.inf))
            out[age, 0] = np.sqrt(_alone(square, part, list(range(b))).gain)
        return out

    def _colour(self) -> Array | None:
        """(W, 1 + n) by how much sizes scatter more than in white noise; None: not known yet."""
        if len(self._usual) < _FEWEST:
            return None
        low = np.nanquantile(np.stack(self._usual), QUIET, axis=0)
        low[:, :1] /= quiet_size(3)
        low[:, 1:] /= quiet_size(1)
        return np.asarray(np.fmax(low, 1.0))

    def _sensor_gain(self) -> float:
        """Largest z^2 of an error of one sensor, since long or sudden, of any number of parts."""
        gains = [0.0]
        square, part = np.zeros((2, 2 * len(self._sensors)))
        for own in self._parts:
            square += np.sum(own.sensors**2, axis=0)
            part += own.sensors.T @ own.data
            gains.append(float(np.max(part**2 / np.maximum(square, _LEAST), initial=0.0)))
        return max(gains)

    def _described(self, age: int, square: Array, part: Array, colour: Array, z: float) -> Event:
        """Torques that act together since so many parts: the fewest that explain what is seen."""
        b = self._base
        every = list(range(len(part)))
        alone = [[b + j] for j in range(len(part) - b)] + ([every[:b]] if b else [])
        rows = sum(len(own.data) for own in self._parts)
        cost = np.log(rows)  # of one more number (Schwarz 1978)
        best = max(alone, key=lambda axes: _alone(square, part, axes).gain - cost * len(axes))
        together = _alone(square, part, every)
        whole = together.gain
        rest = max(LISTED**2 + cost * len(every), _SHAPE * whole)
        if whole - _alone(square, part, best).gain > rest:
            spread = np.diag(together.covariance) * _by_axis(colour, b) ** 2
            sizes = together.coefficients**2 / spread
            least = max(LISTED**2, 0.5 * _SHAPE * whole)
            best = [k for k in every if k < b or sizes[k] > least] or best
        found, scatter = _alone(square, part, best), _by_axis(colour, b)[best]
        torque, covariance = found.coefficients, found.covariance * np.outer(scatter, scatter)
        start, end = self._parts[age].start, self._parts[0].end
        felt = [([i], 1.0, k - b) for i, k in enumerate(best) if k >= b]
        pulses = [
            Transient(
                joint=joint,
                run=0,
                start=start,
                end=end,
                edge=_HELD,
                value=scale * torque[own],
                covariance=np.asarray(scale**2 * covariance[np.ix_(own, own)]),
                z=z,
            )
            for own, scale, joint in felt or [([*range(b)], end - start, BASE)]
        ]
        return event_of(self._robot, pulses, None, end)


def _by_axis(colour: Array, base: int) -> Array:
    """(m,) scatter by axis: one of the base's three, one of each joint."""
    return np.append(np.full(base, colour[0]), colour[1:])


def _alone(square: Array, part: Array, axes: list[int]) -> Projection:
    """Some axes together, without the others."""
    return Projection.of(square[np.ix_(axes, axes)], part[axes])
