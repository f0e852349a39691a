"""Robots in closed loop with a torque that no catalogue knows: at a joint, or by the attitude.

Torque and motion follow the error, and the noise of the sensors is known. Laws are those of
`hidden_laws` that one or two angles or rates tell, tables in the plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from spacerobot_ros.diagnosis.answer.closed_loop_gain import tracking_errors
from spacerobot_ros.diagnosis.answer.extended_model import effects_section, named
from spacerobot_ros.effects.catalogue import bind_effect
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.laws.learned_torque import LearnedTorque
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.rows import Rows
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.record import Record
from spacerobot_ros.types import Array

from .diagnosis_scenario import ROBOTS, motion_of, robot_file, simulated
from .hidden_laws import LAWS, variables_of

FIELD = 'field'
_HELD = ('servicer', 'twin')  # limits of the third leave it no motion on a stand
_OTHERS = ('Dahl', 'play', 'end stop')  # no tables: histories, and what some motions never reach
FLOWN = (*(n for n, (_, a) in LAWS.items() if set(a) <= set('vwqp') and n not in _OTHERS), FIELD)
"""Laws in closed loop; a field's torque about an axis of a free base is b^T R_WB e."""
FREE, FIXED = 'free base', 'fixed base'
_DURATION, _OF_FIELD = 20.0, 60.0  # s: a base turns slowly, and like a drift before it turns back
_BAND = 8.0  # numbers a second of what is slower than 4 Hz
_KNOTS = {1: 801, 2: 161}  # of a table by its inputs, over twice the range of the motion
_BOUNDS = {'limit': 1e6, 'kind': 'external'}
_FASTER = 3.0  # times the speed of the data, at which a law must still be bounded


class LawFlight:
    """One robot, one law.

    Args:
        seed: Of robot, place and noise.
        law: One of `FLOWN`; empty: none.
        ratio: Rms of the law by that of what its sensors' noise leaves of its torque in the band.
        base: `FREE` or `FIXED`.
    """

    def __init__(self, seed: int, law: str, ratio: float, base: str = FREE) -> None:
        rng = np.random.default_rng([seed, 7])
        self._name, self._seed = str(rng.choice(ROBOTS)), seed
        if base == FIXED:
            self._name = f'{rng.choice(_HELD)}, fixed'
        self._law, self._ratio = law, ratio
        self.file = robot_file(self._name)
        self._robot = self.file.robot
        self._j, self._k = rng.choice(len(self._robot.arm), 2, replace=False).tolist()
        self._way = rng.standard_normal(3)
        self.where = 'x' if law == FIELD else self._robot.arm[self._j]
        self._duration = _OF_FIELD if law == FIELD else _DURATION

    @property
    def variables(self) -> list[str]:
        """That a right answer names."""
        own, other = (self._robot.arm[i] for i in (self._j, self._k))
        return ['attitude'] if self._law == FIELD else variables_of(self._law, own, other)

    def record(self) -> Record:
        """With the law."""
        hidden = [self._hidden] if self._law else []
        return simulated(self._name, 'fast', self._seed, hidden, self._duration)

    @property
    def motion(self) -> Motion:
        """That of the record, without the law."""
        return self._quiet.motion

    @cached_property
    def _quiet(self) -> Rows:
        return self._rows(self._seed)

    @cached_property
    def _hidden(self) -> Effect:
        """By its squares over the noise of all sensors: efforts have a part of that only.

        A slow law hides behind encoders' noise where a joint is heavy; on the base there is none.
        About its mean: what hardly changes is a constant torque, and no record tells of what it is
        a function.
        """
        one, quiet = self._sized(1.0), self.motion
        force = one.force(quiet, one.driven(quiet))[:, :, None]
        force = force - np.mean(force, axis=0)
        squares = float(np.sum(self._quiet.whitened(force, {}) ** 2))
        return self._sized(self._ratio * np.sqrt(_BAND * self._duration / squares))

    def _sized(self, size: float) -> Effect:
        """The law, so many times its own words."""
        place, inputs, law = self.where, self.variables, self._table
        if self._law == FIELD:
            place, inputs = f'{self._robot.base_link}/x', [f'attitude/{i}x' for i in 'xyz']
            law = self._by_attitude
        values = {'inputs': inputs, 'range': {name: [-1e3, 1e3] for name in inputs}, **_BOUNDS}
        return bind_effect('hidden', 'learned_torque', place, values | law(size), self._robot)

    def _by_attitude(self, size: float) -> dict[str, Any]:
        return {'form': 'sum of 3', 'coefficients': (size * self._way).tolist()}

    def _table(self, size: float) -> dict[str, Any]:
        j, k, quiet = self._j, self._k, self.motion
        series = {'v': quiet.qd[:, j], 'w': quiet.qd[:, k], 'q': quiet.q[:, j], 'p': quiet.q[:, k]}
        own = [series[letter] for letter in LAWS[self._law][1]]
        reach = np.linspace(-1.0, 1.0, _KNOTS[len(own)])
        knots = [0.5 * (np.max(x) + np.min(x)) + np.ptp(x) * reach for x in own]
        grid = [x.ravel() for x in np.meshgrid(*knots, indexing='ij')]
        by_name = {name: x.tolist() for name, x in zip('xy', knots, strict=False)}
        return {'form': 'table', 'knots': by_name, 'values': (size * self._torque(grid)).tolist()}

    def _torque(self, inputs: Sequence[Array]) -> Array:
        """(N,) of any size, against the motion where it is friction."""
        law, letters = LAWS[self._law]
        of = dict(zip(letters, inputs, strict=True))
        none = np.zeros(len(inputs[0]))
        q, v = (np.column_stack([of.get(a, none), of.get(b, none)]) for a, b in ('qp', 'vw'))
        return -law(q, v, np.zeros_like(q), none, 0, 1)

    def _rows(self, seed: int) -> Rows:
        """Of a flight without the law."""
        record = observed(simulated(self._name, 'fast', seed, (), self._duration), self._robot)
        noise, _ = noise_levels(self._robot.sensors, record)
        return Run(record, self._robot, self.file.effects, noise).rows(())

    def transferred(self, added: Sequence[Effect]) -> float:
        """Share of the law's variance along another motion that what was added explains there."""
        motion, at = self._rows(self._seed + 1).motion, 3 if self._law == FIELD else 6 + self._j
        every = [e for e in added if e.acts('force')]  # a torque of the base is of all its axes
        true, *own = (e.force(motion, e.driven(motion))[:, at] for e in (self._hidden, *every))
        return 1.0 - float(np.var(true - np.sum(own, axis=0)) / np.var(true))

    def removed(self, added: Sequence[Effect]) -> float | None:
        """Share of the tracking error by the law, on another motion, that what was added removes.

        The law's error is that of the true positions from those of a plant without it, whose
        sensors have the same noise. None where nothing is added that a controller feeds forward.
        """
        if not any(e.is_known_ahead for e in added):
            return None
        reference = motion_of(self.file, 'fast', self._seed + 1, self._duration)
        simulator = replace(self.file.settings.simulator, seed=self._seed + 1)
        task = replace(self.file.settings, reference=reference, simulator=simulator)
        plant = replace(task, effects=effects_section([self._hidden]))
        believed = replace(task, effects=effects_section(named(added, ())))
        pairs = ((task, task), (plant, task), (plant, believed))
        quiet, without, with_it = (tracking_errors(self.file, *pair) for pair in pairs)
        return 1.0 - float(np.linalg.norm(with_it - quiet) / np.linalg.norm(without - quiet))


def beyond(laws: Sequence[Effect], motion: Motion) -> tuple[float, float] | None:
    """Largest torque of any law at three times the speed, by that on the motion, and power fed in.

    The latter is the share of what friction exchanges; None where there is no law.
    """
    fast = replace(motion, qd=_FASTER * motion.qd, omega=_FASTER * motion.omega)
    sizes, fed = [0.0], [0.0]
    for law in laws:
        here, there = (law.force(m, law.driven(m)) for m in (motion, fast))
        sizes.append(float(np.max(np.abs(there)) / np.max(np.abs(here))))
        if isinstance(law, LearnedTorque) and (law.kind == 'dissipative' or law.react):
            power = np.sum(there * fast.rates, axis=1)
            given = np.sum(power) if law.hidden else np.sum(np.maximum(power, 0.0))
            fed.append(max(0.0, float(given)) / max(float(np.sum(np.abs(power))), 1e-300))
    return (max(sizes), max(fed)) if laws else None
