"""What the fitted model of a robot whose sensors' noise is known leaves, asked by torque.

Rows are the fit's own whitened innovations, averaged over a tenth of a second sensor by sensor, so
that noise is white and of unit variance in them still. A law's columns are what its torque at one
joint, or about one axis of the base, leaves in these rows; inertial errors and named causes are
columns, too, shared by all channels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from types import MappingProxyType

import numpy as np
from scipy.sparse import csr_array

from ...effects.bodies.bodies import NAMES as INERTIAL
from ...effects.catalogue import CATALOGUE
from ...effects.joint import STICTION_RATE
from ...effects.laws.law_inputs import AXES, input_of
from ...effects.motion import Motion
from ...estimation.columns import candidate_at
from ...estimation.filters.prediction_rows import LABELS
from ...estimation.fit import Fit
from ...estimation.inference.spectral_terms import Level, SpectralTerms, cosines
from ...estimation.rows import BLOCKS
from ...estimation.unknowns.response import Response
from ...types import Array, IntArray
from .arm_channels import is_one_speed
from .possible_laws import (
    Extent,
    Law,
    base_laws,
    joint_laws,
    sensor_laws,
    whole_base_laws,
)
from .time_sines import time_sines

_WINDOW = 0.1  # s
_UNCERTAIN = 0.02  # of a body's mass, first moments and inertia: what passes for a right model
_HIGHEST = 1.0  # Hz, of sines of the time
_RESTING = 0.1  # of a joint's fastest rate
_FREE = 10.0  # times what is left: a named cause's prior deviation
Component = int | slice | None
"""Of the generalized force, where a law acts; None: on a sensor."""
_NOTHING: Mapping[str, Array] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class FlightRows:
    """What a fitted model leaves, and what may be made of it.

    Args:
        fit: The named causes with values.
        gone: Numbers of those in whose place laws are asked: what they do is left, too.
        known: What does not depend on these, once it was computed.
    """

    fit: Fit
    gone: tuple[int, ...] = ()
    known: dict[str, Array] = field(default_factory=dict)

    def without(self, gone: tuple[int, ...]) -> FlightRows:
        """The same with laws in the place of other causes."""
        return replace(self, gone=gone)

    @cached_property
    def motion(self) -> Motion:
        """Along the record, at the times of the filter."""
        return self.fit.rows.motion

    @cached_property
    def _windows(self) -> tuple[csr_array, Array]:
        """Averages of a sensor's rows over a window (R, rows), and their times."""
        at = self.fit.rows.row_times
        window = ((at - at[0]) / _WINDOW).astype(int)
        sensor = self.fit.rows.row_sensors
        number = np.unique(window * (sensor.max() + 1) + sensor, return_inverse=True)[1]
        count = np.bincount(number)
        weights = 1.0 / np.sqrt(count[number])
        shape = (len(count), len(at))
        averages = csr_array((weights, (number, np.arange(len(at)))), shape=shape)
        return averages, np.bincount(number, at) / count

    @property
    def times(self) -> Array:
        """(R,) of rows [s]."""
        return self._windows[1]

    def averaged(self, rows: Array) -> Array:
        """(R, ...) averages of whitened innovations."""
        return np.asarray(self._windows[0] @ rows)

    def rows(self, forces: Array, measured: Mapping[str, Array] = _NOTHING) -> Array:
        """(R, K) what generalized forces (N, 6 + n, K) and readings leave, see `Rows.whitened`."""
        return self.averaged(self.fit.rows.whitened(forces, measured))

    @cached_property
    def sensors(self) -> dict[str, tuple[str, int]]:
        """By channel, such as `gyro/x`: the sensor, and the number of the axis or joint."""
        joints = self.motion.robot.joints
        out: dict[str, tuple[str, int]] = {}
        for sensor in self.fit.rows.samples():
            if sensor in LABELS and (self.motion.robot.is_free or sensor[0] == 'j'):
                names = joints if sensor[0] == 'j' else AXES
                out |= {f'{LABELS[sensor][0]}/{name}': (sensor, k) for k, name in enumerate(names)}
        return out

    def has_one_speed(self, joint: str) -> bool:
        """Whether a joint moves at one speed where it moves, see `is_one_speed`."""
        rate = self.motion.qd[:, self.motion.robot.joints.index(joint)]
        fastest = float(np.max(np.abs(rate)))
        moving = rate[np.abs(rate) > _RESTING * fastest]
        return fastest > STICTION_RATE and is_one_speed([moving])

    def motion_at(self, place: str) -> Motion:
        """Where a law acts: at the samples of its sensor, or at the times of the filter."""
        if place not in self.sensors:
            return self.motion
        return self.fit.rows.samples()[self.sensors[place][0]][1]

    def rows_at(self, place: str, component: Component, values: Array) -> Array:
        """(R, K) what values (N, K) of a law leave, see `motion_at`.

        Args:
            place: Of the law.
            component: Of the generalized force.
            values: Torques, or what the sensor reads too much; (N, K, 3) of a whole base.
        """
        width = 6 + self.motion.robot.n_joints
        forces = np.zeros((len(self.motion), width, values.shape[1]))
        if component is not None:
            forces[:, component] = np.swapaxes(values, 1, -1)
            return self.rows(forces)
        sensor, axis = self.sensors[place]
        count = len(self.motion.robot.joints) if sensor[0] == 'j' else len(AXES)
        reading = np.zeros((len(values), count, values.shape[1]))
        reading[:, axis] = values
        return self.rows(forces, {sensor: reading})

    @cached_property
    def data(self) -> Array:
        """(R,)."""
        parts = (self.fit.changed(i) for i in self.gone)
        return self.averaged(sum(parts, start=self.fit.data))

    @property
    def tolerated(self) -> Array:
        """(R, K) of inertial errors by their deviations."""
        if 'tolerated' not in self.known:
            self.known['tolerated'] = self._tolerated()
        return self.known['tolerated']

    def _tolerated(self) -> Array:
        robot, response = self.motion.robot, Response(self.motion.robot, self.motion)
        kind, forces = CATALOGUE['inertial_parameters'], []
        first = 0 if robot.is_free else 1
        for body, row in zip(robot.bodies[first:], robot.inertial_parameters[first:], strict=True):
            candidate = candidate_at(kind, robot, body.name, {})
            if candidate is not None:
                observable = [INERTIAL.index(p.name) for p in candidate.parameters]
                sizes = _plausible(row)[observable].tolist()
                steps = zip(candidate.small_steps, sizes, strict=True)
                forces += [
                    response.force(effect) * (_UNCERTAIN * size / step)
                    for (effect, step), size in steps
                ]
        return self.rows(np.stack(forces, axis=2)) if forces else np.zeros((len(self.times), 0))

    @cached_property
    def named(self) -> Array:
        """(R, K) of named causes, of any size."""
        kept = [k for k, (i, _) in enumerate(self.fit.free) if i not in self.gone]
        own = self.averaged(self.fit.tangents[:, kept])
        size = np.maximum(np.sqrt(np.mean(own**2, axis=0)), 1e-300)
        left = float(np.sqrt(np.mean(self.data**2)))
        return np.asarray(own * (_FREE * left / size))

    @cached_property
    def extent(self) -> Extent:
        """What the motion covers."""
        m = self.motion
        return Extent.of(m.robot.joints, m.q, m.qd, float(np.ptp(m.time)))


@dataclass(frozen=True, eq=False)
class FlightChannel:
    """Laws of all torques and readings: what one does shows in every sensor.

    Args:
        flight: What is left.
        components: By place: a joint, an axis of the base such as `base_link/x`, the whole base,
            or a sensor's channel.
        known: Terms of all its laws, once they were computed; None: not kept.
    """

    flight: FlightRows
    components: Mapping[str, Component]
    known: dict[str, list[Array]] | None = None

    place = ''

    def without(self, gone: tuple[int, ...]) -> FlightChannel:
        """The same with laws in the place of some causes."""
        return replace(self, flight=self.flight.without(gone))

    @cached_property
    def laws(self) -> Sequence[Law]:
        """That may be, at every place."""
        return [
            replace(law, place=place) for place in self.components for law in self._laws_at(place)
        ]

    def _laws_at(self, place: str) -> list[Law]:
        at, extras = self.flight.extent, list(self.flight.motion.extra)
        if place in self.flight.sensors:
            return sensor_laws(place, extras)
        if isinstance(self.components[place], slice):
            return whole_base_laws()
        if '/' in place:
            own = base_laws(place[-1], at)
        else:
            robot = self.flight.motion.robot
            own = joint_laws(place, robot.ways(robot.arm), extras, at)
        return [*own, *time_sines(at.duration, _HIGHEST)]

    @property
    def extent(self) -> Extent:
        """What the motion covers."""
        return self.flight.extent

    @property
    def times(self) -> Array:
        """(R,) of rows [s]."""
        return self.flight.times

    @cached_property
    def part(self) -> IntArray:
        """(R,) fifth of each row."""
        count = len(self.times)
        return np.arange(count) * BLOCKS // count

    @cached_property
    def terms(self) -> SpectralTerms:
        """The leftover's, with an offset of every torque and reading."""
        return self._terms(has_offsets=True)

    def fitted(self, columns: Array, *, is_tolerant: bool = True) -> Level:
        """What (M, k) columns of laws leave, fitted as they are applied.

        No torque has an offset that is not named; readings have, whose laws are said alone.

        Args:
            columns: Of the laws.
            is_tolerant: Whether beside errors of masses and inertias, which nobody applies.
        """
        return self._terms(has_offsets=False, is_tolerant=is_tolerant).level(columns)

    def _terms(self, *, has_offsets: bool, is_tolerant: bool = True) -> SpectralTerms:
        flight, offsets, is_torque = self.flight, [], []
        for place, component in self.components.items():
            if component is None or (has_offsets and isinstance(component, int)):
                one = np.ones((len(flight.motion_at(place)), 1))
                offsets.append(_FREE * flight.rows_at(place, component, one))
                is_torque.append(component is not None)
        named = flight.named.shape[1]
        tolerated = [flight.tolerated] if is_tolerant else []
        nuisance = np.column_stack([flight.named, *offsets, *tolerated])
        is_free = np.zeros(nuisance.shape[1], dtype=bool)
        # a sensor's shift with what is measured may be small beside what is measured
        is_free[:named], is_free[named : named + len(offsets)] = True, is_torque
        return SpectralTerms.of(flight.data, nuisance, is_free, lambda rows: rows)

    def law_columns(self, law: Law) -> Array:
        """(N, k), or (N, k, 3) of the whole base: a law's columns, see `FlightRows.motion_at`."""
        motion = self.flight.motion_at(law.place)
        inputs = [input_of(name, motion) for name in law.inputs]
        return law.form([np.asarray(x) for x in inputs], law.options)

    def ranges(self, law: Law) -> dict[str, tuple[float, float]]:
        """Smallest and largest of every input."""
        motion = self.flight.motion
        inputs = {name: np.asarray(input_of(name, motion)) for name in law.inputs}
        return {name: (float(np.min(x)), float(np.max(x))) for name, x in inputs.items()}

    def columns(self, laws: Sequence[Law]) -> list[Array]:
        """(M, k) terms of the columns of each law; the filter takes those of a place at once."""
        if laws is not self.laws or self.known is None:
            return self._columns(laws)
        if 'all' not in self.known:
            self.known['all'] = self._columns(laws)
        return self.known['all']

    def _columns(self, laws: Sequence[Law]) -> list[Array]:
        out: list[Array] = []
        for place, own in groupby(laws, key=lambda law: law.place):
            values = [self.law_columns(law) for law in own]
            ends = np.cumsum([v.shape[1] for v in values])[:-1].tolist()
            together = np.concatenate(values, axis=1)
            rows = self.flight.rows_at(place, self.components[place], together)
            out += np.split(cosines(rows), ends, axis=1)
        return out


def _plausible(row: Array) -> Array:
    """(10,) sizes of a body's mass, first moments and inertia."""
    mass = float(row[0])
    com = float(np.linalg.norm(row[1:4])) / max(mass, 1e-9)
    gyration = float(np.sqrt(max(row[4] + row[6] + row[9], 0.0) / max(mass, 1e-9)))
    arm = max(com, gyration)
    return mass * np.array([1.0, *[arm] * 3, *[arm**2] * (len(INERTIAL) - 4)])
