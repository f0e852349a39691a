r"""How the base moves, and what torque that takes, when the joints follow given motions.

Nothing pushes a free robot, so its total momentum is constant, and with the centre of mass at rest

    h_B' = h_B x w,    w = D^-1 (h_B - Dq q' - h0 - sum_b R_b h_b)

gives momentum h_B and rate w of the base, in its own axes, from the joints alone; the attitude
follows from R' = R w^x, and h_B = R^T h_W closes the circle. D and Dq are CRBA's, torques RNEA's.

Everything is computed for all candidates and times at once, in base coordinates; only h_B and R
are advanced step by step. Symbols: N = B T states, n joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ...dynamics.compiling import Triple, compiled, inner
from ...dynamics.crba import crba
from ...dynamics.equations import joint_torques, without_translation
from ...dynamics.forward_kinematics import forward_kinematics
from ...dynamics.rotation import cross_rows
from ...dynamics.tree import tree_of
from ...model.robot import Robot
from ...model.settings import SimulatorSettings
from ...recording.record import AttitudeSeries, JointSeries, RateSeries, Record, to_stamps
from ...types import Array, Matrix3, Vector3
from .reference import Kinematics


@dataclass(frozen=True, slots=True, eq=False)
class BaseMotion:
    """Motion of B candidates at T times.

    Args:
        time: (T,) [s].
        q, qd, qdd: (B, T, n) joint positions, rates and accelerations.
        omega: (B, T, 3) omega_WB_B [rad/s].
        R_WB: (B, T, 3, 3) attitudes.
        torque: (B, T, n) joint torques [N m].
        inverse: (B, T, 3, 3) D^-1 [1/(kg m^2)]. coupling: (B, T, 3, n) D^-1 Dq.
        h_W: (B, 3) total momentum, inertial frame [N m s].
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    omega: Array
    R_WB: Array
    torque: Array
    inverse: Array
    coupling: Array
    h_W: Array

    @property
    def kinematics(self) -> Kinematics:
        """The motions one after the other, B T states in all."""
        n = self.q.shape[-1]
        return Kinematics(
            np.tile(self.time, len(self.q)),
            self.q.reshape(-1, n),
            self.qd.reshape(-1, n),
            self.omega.reshape(-1, 3),
            Rotation.from_matrix(self.R_WB.reshape(-1, 3, 3)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class BaseStart:
    """How the base starts.

    Args:
        attitude_xyzw: (4,) q_WB.
        omega: (3,) omega_WB_B [rad/s].
    """

    attitude_xyzw: Array
    omega: Vector3


class BaseResponse:
    """A robot whose joints follow given motions; its base gives way, or rests where it is fixed.

    Args:
        robot: Its captured wheels' momentum as assumed.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._tree = robot, tree_of(robot)
        self._wheels = [(g.body, g.body_momentum) for g in robot.gyrostats]

    def spun_up(self, q: Array, h0: Vector3) -> Vector3:
        """(3,) rate of a robot at rest just after wheels of its base were spun up to h0.

        The wheels' spin-up takes no angular momentum from outside: D w + h0 = 0, eq. (30) of the
        identification paper.
        """
        return np.asarray(-np.linalg.solve(self._place(q[None])[0][0], h0), dtype=float)

    def move(self, time: Array, q: Array, qd: Array, qdd: Array, start: BaseStart) -> BaseMotion:
        """Follow joint motions.

        Args:
            time: (T,) increasing, equally spaced [s].
            q: (B, T, n) joint positions [rad].
            qd: (B, T, n) joint rates [rad/s].
            qdd: (B, T, n) joint accelerations [rad/s^2].
            start: Of the base, the same for all.
        """
        batch, steps, n = q.shape
        D, Dq, rotations = self._place(q.reshape(-1, n))
        shape = (batch, steps)
        inverse = np.asarray(np.linalg.inv(D) if self._robot.is_free else D, dtype=float)
        coupling = inverse @ Dq
        spin = np.zeros((batch * steps, 3))
        for body, h in self._wheels:
            spin += rotations[:, body] @ h
        own = _apply(inverse, spin) + _apply(coupling, qd.reshape(-1, n))
        D, inverse, own = (x.reshape((*shape, *x.shape[1:])) for x in (D, inverse, own))
        attitude = Rotation.from_quat(start.attitude_xyzw).as_matrix()
        h_B0 = _apply(D[:, 0], start.omega + own[:, 0])
        h_W = h_B0 @ attitude.T
        h_B = _propagate_momentum(time, inverse, own, h_B0)
        R_WB = _integrate_attitude(time, _apply(inverse, h_B) - own, attitude)
        omega = _apply(inverse, np.einsum('btij,bi->btj', R_WB, h_W)) - own
        flat = (x.reshape(batch * steps, -1) for x in (q, qd, qdd, omega))
        torque = joint_torques(self._robot, *flat).reshape(*shape, n)
        coupling = coupling.reshape(*shape, 3, n)
        return BaseMotion(time, q, qd, qdd, omega, R_WB, torque, inverse, coupling, h_W)

    def _place(self, q: Array) -> tuple[Array, Array, Array]:
        """D (N, 3, 3), Dq (N, 3, n) about the centre of mass, and the bodies' rotations.

        Both are zero where the base is fixed.
        """
        n = q.shape[1]
        q = np.ascontiguousarray(q, dtype=float)
        kinematics = forward_kinematics(self._tree, q, np.zeros((len(q), 6 + n)), q)
        if not self._robot.is_free:
            return np.zeros((len(q), 3, 3)), np.zeros((len(q), 3, n)), kinematics.rotations
        M = without_translation(crba(self._tree, kinematics))
        return M[:, :3, :3], M[:, :3, 3:], kinematics.rotations


def noise_free_record(robot: Robot, motion: BaseMotion, rates: SimulatorSettings) -> Record:
    """The first candidate as sensors without noise see it, each as often as its rate says.

    Args:
        robot: What moves; with a fixed base, there are joints alone.
        motion: At the times of the fastest sensor, or more often.
        rates: Of the sensors.
    """
    often = 1.0 / float(motion.time[1] - motion.time[0])
    stamps = to_stamps(motion.time)
    joint, imu, tracker = (
        slice(None, None, max(1, round(often / rate)))
        for rate in (rates.joint_rate, rates.imu_rate, rates.attitude_rate)
    )
    q, qd, torque = motion.q[0, joint], motion.qd[0, joint], motion.torque[0, joint]
    record = Record(joints=JointSeries(robot.joints, stamps[joint], q, qd, torque))
    if not robot.is_free:
        return record
    q_xyzw = Rotation.from_matrix(motion.R_WB[0, tracker]).as_quat()
    return replace(
        record,
        rates=RateSeries(stamps[imu], motion.omega[0, imu]),
        attitudes=AttitudeSeries(stamps[tracker], q_xyzw),
    )


def _propagate_momentum(time: Array, inverse: Array, own: Array, h_B: Array) -> Array:
    """(B, T, 3) h_B along the motion: classical Runge-Kutta, maps interpolated in between."""
    middle = 0.5 * (time[1:] + time[:-1])
    between = [np.ascontiguousarray(CubicSpline(time, x, axis=1)(middle)) for x in (inverse, own)]
    out = np.empty_like(own)
    out[:, 0] = h_B
    _runge_kutta(float(time[1] - time[0]), inverse, own, *between, out)
    return out


@inner
def _slope(h: Triple, maps: Array, offset: Array) -> Triple:
    """Rate of h: h x (maps h - offset)."""
    x, y, z = h
    a = maps[0, 0] * x + maps[0, 1] * y + maps[0, 2] * z - offset[0]
    b = maps[1, 0] * x + maps[1, 1] * y + maps[1, 2] * z - offset[1]
    c = maps[2, 0] * x + maps[2, 1] * y + maps[2, 2] * z - offset[2]
    return y * c - z * b, z * a - x * c, x * b - y * a


@inner
def _ahead(h: Triple, dt: float, slope: Triple) -> Triple:
    return h[0] + dt * slope[0], h[1] + dt * slope[1], h[2] + dt * slope[2]


@compiled
def _runge_kutta(
    dt: float, maps: Array, offsets: Array, mid_maps: Array, mid_offsets: Array, out: Array
) -> None:
    """(B, T, 3) momenta from the first of each; NumPy takes 9 times as long for 5 candidates."""
    for b in range(len(out)):
        h = (out[b, 0, 0], out[b, 0, 1], out[b, 0, 2])
        # constant; kept, so that no candidate is too fast to judge
        size = np.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
        for k in range(out.shape[1] - 1):
            k1 = _slope(h, maps[b, k], offsets[b, k])
            k2 = _slope(_ahead(h, 0.5 * dt, k1), mid_maps[b, k], mid_offsets[b, k])
            k3 = _slope(_ahead(h, 0.5 * dt, k2), mid_maps[b, k], mid_offsets[b, k])
            k4 = _slope(_ahead(h, dt, k3), maps[b, k + 1], offsets[b, k + 1])
            for slope, share in ((k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)):
                h = _ahead(h, share * dt / 6.0, slope)
            moved = np.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
            scale = size / max(moved, 1e-300)
            h = (scale * h[0], scale * h[1], scale * h[2])
            out[b, k + 1, 0], out[b, k + 1, 1], out[b, k + 1, 2] = h


def _integrate_attitude(time: Array, omega: Array, first: Matrix3) -> Array:
    """(B, T, 3, 3) attitudes of body rates (B, T, 3): fourth-order Magnus steps."""
    dt = time[1] - time[0]
    shift = np.sqrt(3.0) / 6.0
    between = CubicSpline(time, omega, axis=1)
    early, late = (between(time[:-1] + (0.5 + s) * dt) for s in (-shift, shift))
    turns = 0.5 * dt * (early + late) + 0.5 * shift * dt**2 * cross_rows(early, late)
    steps = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(*turns.shape, 3)
    out = np.empty((*omega.shape, 3))
    out[:, 0] = first
    for k in range(len(time) - 1):
        out[:, k + 1] = out[:, k] @ steps[:, k]
    return out


def _apply(matrix: Array, vector: Array) -> Array:
    """Stacked matrices (..., a, b) on stacked vectors (..., b)."""
    return (matrix @ vector[..., None])[..., 0]
