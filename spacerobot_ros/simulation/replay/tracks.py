"""Where base and joints are at even times: as measured, and as the model would have moved them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.equations import Dynamics
from ...dynamics.integrate import RK4
from ...dynamics.state import State
from ...effects.motion import Motion
from ...effects.robot_file import RobotFile
from ...errors import ConfigurationError, SimulationDivergedError
from ...model.robot import Robot
from ...model.robot_settings import COMPENSATED
from ...recording.record import Record
from ...types import Array
from ..plant import Plant

RATE, MOST = 30.0, 3600  # frames a second, and of a page
RESTART = 2.0
"""Seconds after which a prediction begins again where the robot was measured: long enough for an
error of 1 % to be seen, short enough for an arm under gravity to stay in the picture."""
ASTRAY = 0.3
"""Of a joint [rad, m]: there a prediction begins again, too. Light joints without a controller go
astray within tenths of a second, and say no more then."""
_STEPS = 6000  # of a prediction: bounds the time that a page takes
_TRIES = 50  # beginnings, after which a prediction that lasts no two frames each is none


@dataclass(frozen=True, slots=True, eq=False)
class RobotTrack:
    """A robot at N times.

    Args:
        time: (N,) [s].
        position: (N, 3) base origin in the inertial frame [m].
        attitude_xyzw: (N, 4) q_WB.
        q: (N, n) joint positions [rad, m].
        qd: (N, n) joint rates [rad/s, m/s].
        omega: (N, 3) omega_WB_B [rad/s].
    """

    time: Array
    position: Array
    attitude_xyzw: Array
    q: Array
    qd: Array
    omega: Array

    def state(self, k: int) -> State:
        """At one time, the base origin at rest."""
        at = self.position[k], self.attitude_xyzw[k], self.q[k]
        return State(*at, np.zeros(3), self.omega[k], self.qd[k])


def frame_times(record: Record) -> Array:
    """(N,) even times over the record."""
    start, end = ((stamp - record.origin_ns) / 1e9 for stamp in record.span_ns)
    count = int(np.clip(np.ceil((end - start) * RATE) + 1, 2, MOST))
    return np.linspace(start, end, count)


def measured_track(record: Record, robot: Robot, time: Array) -> RobotTrack:
    """As measured; where the base's position is not, its centre of mass is taken to be at rest."""
    q, qd = _joints(record, robot, time)
    attitude, omega = _base(record, robot, time)
    zeros = np.zeros((len(time), 3))
    track = RobotTrack(time, zeros, attitude, q, qd, omega)
    return replace(track, position=_centred(robot, track)) if robot.is_free else track


def predicted_track(
    record: Record, file: RobotFile, measured: RobotTrack
) -> tuple[RobotTrack | None, str]:
    """What the model makes of the measured efforts, from the measured state every `RESTART`.

    Returns:
        None where there are no efforts of the whole torque, or no such motion; and why.
    """
    effort, robot = record.effort, file.believed
    if effort is None:
        return None, 'no efforts were measured: the model predicts nothing'
    if COMPENSATED in robot.effort_kinds:
        return None, 'efforts without gravity: the model predicts nothing'
    rows: list[Array] = []
    impulse, tries = _impulse(record), 0
    try:
        while len(rows) < len(measured.time):
            rows += _run(record, file, measured, impulse, len(rows))
            tries += 1
            if tries >= _TRIES and len(rows) < 2 * tries:
                why = f'the model is {ASTRAY:g} rad or m astray within a frame'
                return None, f'{why}, and predicts nothing'
    except (SimulationDivergedError, ConfigurationError) as error:
        return None, f'the model can not be simulated, and predicts nothing: {error}'
    n = robot.n_joints
    position, attitude, q, _, omega, qd = np.split(
        np.array(rows), np.cumsum([3, 4, n, 3, 3]).tolist(), axis=1
    )
    return RobotTrack(measured.time, position, attitude, q, qd, omega), ''


def _run(
    record: Record,
    file: RobotFile,
    measured: RobotTrack,
    impulse: Callable[[float], Array],
    first: int,
) -> Iterator[Array]:
    """State vectors at the frames from a restart to the next."""
    robot = file.believed
    times, since = record.effort_time, measured.time - measured.time[first]
    period = max(float(np.median(np.diff(times))), float(np.ptp(measured.time)) / _STEPS)
    start = Dynamics(robot).at_rest_centre(measured.state(first))
    plant = Plant(robot, start, period, 1, file.effects, RK4)
    before = now = start.to_vector()
    for k in range(first, len(since)):
        if since[k] > RESTART:
            return
        while plant.time_ns / 1e9 < since[k] - 1e-9:
            at = measured.time[first] + plant.time_ns / 1e9
            plant.step((impulse(at + period) - impulse(at)) / period)
            before, now = now, plant.state.to_vector()
        late = max(plant.time_ns / 1e9 - since[k], 0.0) / period
        x = (1.0 - late) * now + late * before
        if k > first and np.max(np.abs(State.from_vector(x).q - measured.q[k])) > ASTRAY:
            return
        yield x


def _impulse(record: Record) -> Callable[[float], Array]:
    """Time integral of the efforts, each held over the step that ends at its stamp [N m s]."""
    times, effort = record.effort_time, np.nan_to_num(np.asarray(record.effort))
    sums = np.cumsum(effort * np.diff(times, prepend=times[:1])[:, None], axis=0)

    def at(time: float) -> Array:
        after = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        start, end = times[after - 1], times[after]
        share = min(max((time - start) / (end - start), 0.0), 1.0)
        return np.asarray(sums[after - 1] + share * (sums[after] - sums[after - 1]))

    return at


def _joints(record: Record, robot: Robot, time: Array) -> tuple[Array, Array]:
    n = robot.n_joints
    if record.joints is None or len(record.joint_time) < 4:
        return np.zeros((len(time), n)), np.zeros((len(time), n))
    inside = np.clip(time, *record.joint_time[[0, -1]])
    curve = make_interp_spline(record.joint_time, record.q, k=3)
    if record.qd is not None:
        rates = [np.interp(inside, record.joint_time, column) for column in record.qd.T]
        return np.asarray(curve(inside)), np.column_stack(rates)
    return np.asarray(curve(inside)), np.asarray(curve(inside, 1))


def _base(record: Record, robot: Robot, time: Array) -> tuple[Array, Array]:
    """Attitudes and rates; of the gyro alone its integral from no turn at the start."""
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)), np.zeros((len(time), 3))
    if not robot.is_free:
        return still
    attitude, omega = record.attitude, None
    if len(record.rate_time) > 1:
        omega = np.column_stack(
            [np.interp(time, record.rate_time, column) for column in record.omega.T]
        )
    if attitude is not None and len(record.attitude_time) > 1:
        seen = Slerp(record.attitude_time, attitude)(np.clip(time, *record.attitude_time[[0, -1]]))
    elif omega is not None:
        turns = Rotation.from_rotvec(0.5 * (omega[1:] + omega[:-1]) * np.diff(time)[:, None])
        found = [Rotation.identity()]
        for turn in turns:
            found.append(found[-1] * turn)
        seen = Rotation.concatenate(found)
    else:
        return still
    if omega is None:
        steps = (seen[:-1].inv() * seen[1:]).as_rotvec() / np.diff(time)[:, None]
        omega = np.vstack([steps, steps[-1:]])
    return np.asarray(seen.as_quat()), omega


def _centred(robot: Robot, track: RobotTrack) -> Array:
    """(N, 3) base origin where the centre of mass rests at the inertial origin."""
    still = np.zeros_like(track.q)
    centres = Motion(robot, track.time, track.q, still, still).centres
    centre = np.average(centres, axis=1, weights=robot.inertial_parameters[:, 0])
    return -np.asarray(Rotation.from_quat(track.attitude_xyzw).apply(centre))
