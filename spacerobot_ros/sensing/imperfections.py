"""What makes sensors real: noise, bias walk, limits, steps, lost and badly timed samples.

Every random stream is keyed by the seed and by its place in `STREAMS`, so a sensor that is added,
silenced or sampled at another rate leaves the noise of all others as it was. What a late sensor
says was true a while ago (`StateHistory`).
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import replace

import numpy as np

from ..dynamics.integrate import cubic_hermite
from ..dynamics.rotation import cross, rotation_between, turned
from ..dynamics.state import State
from ..model.robot_settings import SensorSettings
from ..model.settings import SimulatorSettings
from ..types import Array, Vector3

# Append only: the place of a name is part of what a seed means.
STREAMS = (
    'joint_position',
    'joint_velocity',
    'joint_effort',
    'gyro',
    'attitude',
    'wheel_rate',
    'gyro_bias_walk',
    'joints_lost',
    'imu_lost',
    'attitude_lost',
    'joints_jitter',
    'imu_jitter',
    'attitude_jitter',
)
CHANNELS = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
CLOCKS = {'joints': 'joint', 'imu': 'imu', 'attitude': 'attitude'}
"""Clocks, and what their settings' names begin with."""


class Imperfections:
    """Noise and limits of all sensors of one simulated robot.

    Args:
        sensors: Standard deviations, a missing one meaning no noise, and limits.
        settings: Seed, rates, and whether anything is random at all.
    """

    def __init__(self, sensors: SensorSettings, settings: SimulatorSettings) -> None:
        self._streams = {
            name: np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=(place,)))
            for place, name in enumerate(STREAMS)
        }
        random = 1.0 if settings.noise else 0.0
        std = {channel: getattr(sensors, f'{channel}_std') or 0.0 for channel in CHANNELS}
        # a tachometer is as noisy as a joint's rate
        std['wheel_rate'] = sensors.std('joint_velocity') or 0.0
        self._std = {
            name: random * np.array(value) if random and np.any(value) else None
            for name, value in std.items()
        }
        self._resolution = {
            channel: getattr(sensors, f'{channel}_resolution', 0.0) for channel in CHANNELS
        }
        self._lost, self._jitter, self._drift = (
            {clock: share * getattr(sensors, f'{name}_{what}') for clock, name in CLOCKS.items()}
            for what, share in (('dropout', random), ('jitter', random), ('clock_drift', 1.0))
        )
        self._walk = random * sensors.gyro_bias_walk / math.sqrt(settings.imu_rate)
        self._bias: Vector3 = np.zeros(3)
        self._gyro_range = sensors.gyro_range or math.inf
        self._blind_above = sensors.attitude_rate_limit or math.inf

    def most_late(self, clock: str, time: float) -> float:
        """Largest lateness of a clock's stamps around a time, fixed delays excluded [s]."""
        return self._jitter[clock] + self._drift[clock] * time

    def late(self, clock: str, time: float) -> float:
        """Lateness of one stamp [s]; takes from the clock's stream."""
        late = self._drift[clock] * time
        if self._jitter[clock]:
            late += self._jitter[clock] * float(self._streams[f'{clock}_jitter'].random())
        return late

    def is_lost(self, clock: str, step_index: int) -> bool:
        """Whether a sample is lost; the first never is, for it starts whoever waits for it."""
        if not self._lost[clock]:
            return False
        draw = float(self._streams[f'{clock}_lost'].random())
        return step_index > 0 and draw < self._lost[clock]

    def is_blind(self, omega: Vector3) -> bool:
        """Whether the star tracker sees nothing at a body rate [rad/s]."""
        return float(np.linalg.norm(omega)) > self._blind_above

    def rate(self, omega: Vector3) -> Vector3:
        """(3,) what the gyro says: noise and walking bias, within its range [rad/s]."""
        if self._walk:
            step = self._streams['gyro_bias_walk'].standard_normal(3)
            self._bias = self._bias + self._walk * step
            omega = omega + self._bias
        noisy = self.noisy('gyro', omega, stepped=False)
        if self._gyro_range < math.inf:
            noisy = np.clip(noisy, -self._gyro_range, self._gyro_range)
        return self._stepped('gyro', noisy)

    def noisy(self, name: str, values: Array, *, stepped: bool = True) -> Array:
        """Values with white noise, rounded to the sensor's steps."""
        std = self._std[name]
        if std is None:
            out = np.array(values, dtype=float)
        else:
            out = values + std * self._streams[name].standard_normal(len(values))
        return self._stepped(name, out) if stepped else out

    def _stepped(self, name: str, values: Array) -> Array:
        step = self._resolution.get(name, 0.0)
        return np.round(values / step) * step if step else values


_SAME = 1e-9  # s: a sum of floating-point periods and the time it stands for


class StateHistory:
    """States of past steps, and between them by cubic Hermite interpolation.

    Positions and their rates are matched at both ends of a step, under a torque that is held over
    it: rates are right to h^3 / 125 of their third derivative. Before the first step the robot
    coasts into it.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._moments: list[tuple[State, Array, Array]] = []  # with effort and hidden states

    def __len__(self) -> int:
        """Number of steps that are remembered."""
        return len(self._times)

    def add(self, time: float, state: State, effort: Array, hidden: Array, span: float) -> None:
        """Take the state at a time later than all before; forget what is older than `span`.

        Args:
            time: [s].
            state: True state.
            effort: (n,) torque over the step that ended there [N m].
            hidden: Own states of all effects.
            span: Time that may be asked for, back from now [s].
        """
        self._times.append(time)
        self._moments.append((state, effort, hidden))
        old = bisect_left(self._times, time - span) - 1  # the step that spans the oldest time
        if old > 0:
            del self._times[:old], self._moments[:old]

    def state(self, time: float) -> State:
        """State at a time not after the newest [s]."""
        k, share = self._place(time)
        after = self._moments[k][0]
        if share == 1.0:
            return after
        if k == 0:
            return _coasted(after, time - self._times[0])
        step = self._times[k] - self._times[k - 1]
        return _between(self._moments[k - 1][0], after, time - self._times[k - 1], step)

    def effort(self, time: float) -> Array:
        """(n,) torque over the step that ends at or after a time [N m]; zero before the first."""
        return self._moments[self._place(time)[0]][1]

    def hidden(self, time: float) -> Array:
        """Own states of all effects at a time, linear between steps; at rest before the first."""
        k, share = self._place(time)
        after = self._moments[k][2]
        if k == 0 or share == 1.0:
            return after
        before = self._moments[k - 1][2]
        return before + share * (after - before)

    def _place(self, time: float) -> tuple[int, float]:
        """The step that ends at or after a time, and the share of it that is over by then."""
        k = bisect_left(self._times, time - _SAME)
        if abs(self._times[k] - time) <= _SAME:
            return k, 1.0
        if k == 0:
            return 0, 0.0
        return k, (time - self._times[k - 1]) / (self._times[k] - self._times[k - 1])


def _coasted(state: State, dt: float) -> State:
    attitude = turned(state.q_WB_xyzw, state.omega_WB_B * dt)
    return replace(state, q_WB_xyzw=attitude, q=state.q + state.qd * dt)


def _between(a: State, b: State, t: float, h: float) -> State:
    q, qd = cubic_hermite(a.q, b.q, a.qd, b.qd, t, h)
    step = rotation_between(a.q_WB_xyzw, b.q_WB_xyzw)
    # rate of the rotation vector from a: J^-1 omega, to third order of the small step
    end = b.omega_WB_B + 0.5 * cross(step, b.omega_WB_B)
    end = end + cross(step, cross(step, b.omega_WB_B)) / 12.0
    turn, rate = cubic_hermite(np.zeros(3), step, a.omega_WB_B, end, t, h)
    omega = rate - 0.5 * cross(turn, rate) + cross(turn, cross(turn, rate)) / 6.0
    share, attitude = t / h, turned(a.q_WB_xyzw, turn)
    p, v = a.p_WB + share * (b.p_WB - a.p_WB), a.v_WB_B + share * (b.v_WB_B - a.v_WB_B)
    return State(p, attitude, q, v, omega, qd)
