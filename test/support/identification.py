"""Simulated runs for the identification tests, from first principles.

The joints follow the motion of Table II exactly; the base follows from the conservation of angular
momentum, its attitude integrated by DOP853. Nothing here calls the product's dynamics: momentum is
summed over the bodies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spacerobot_ros.estimation.trajectory.reference import NoiseLevels
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.recording.record import (
    AttitudeSeries,
    JointSeries,
    RateSeries,
    Record,
    to_stamps,
)
from support.models import (
    ATTITUDE_XYZW,
    H_BASE,
    H_TARGET,
    OMEGA,
    Part,
    quaternion_matrix,
    robot_of,
    table_one,
    to_rotation,
    turn,
)

STDS = {
    'joint_position_std': 2.0e-5,
    'joint_velocity_std': 2.0e-4,
    'gyro_std': 2.0e-5,
    'attitude_std': 3.0e-5,
}
NOISE = NoiseLevels(
    **{name.removesuffix('_std'): std for name, std in STDS.items()}, joint_effort=0.05
)
SENSORS = SensorSettings(**STDS)
SILENT = SensorSettings()
ORIGIN_NS = 10**18  # as on a real clock
PERIOD = 20.0  # s, of the motion of Table II
_SINE = [[0.1234, -0.1867, 0.0005], [0.1306, -0.1222, -0.3760], [0.15486, -0.1269, 0.4030]]
_COSINE = [[0.1600, -0.3808, 0.0513], [-0.1179, 0.1787, -0.1333], [-0.0458, 0.1346, 0.1389]]


@cache  # what the product knows of a robot that it has seen it need not find again
def servicer(axes: str = 'zyx', sensors: SensorSettings = SENSORS, *, prior: float = 1.0) -> Robot:
    """The product's robot of Table I that knows nothing of the captured wheels.

    Args:
        axes: Joint axes.
        sensors: What its file says of the noise.
        prior: Factor on the inertial parameters that it believes in, alternating with its inverse.
    """
    robot = robot_of(
        table_one(axes),
        servicer_wheels={'momentum': list(H_BASE)},
        target_wheels={'links': ['link_3'], 'momentum': [0.0, 0.0, 0.0]},
    )
    factors = np.array([prior, 1.0 / prior, prior, 1.0 / prior])
    wrong = robot.with_inertial_parameters(robot.inertial_parameters * factors[:, None])
    return replace(wrong, sensors=sensors)


@dataclass(frozen=True)
class Tree:
    """Where the bodies are: positions from the base origin, rotations to base axes, and Jacobians.

    Args:
        rotations: (..., b, 3, 3). centres: (..., b, 3) centres of mass.
        angular: (..., b, 3, 3 + n) and linear: as many, of the centres, by [omega_B; q'].
    """

    rotations: np.ndarray
    centres: np.ndarray
    angular: np.ndarray
    linear: np.ndarray


def place(parts: list[Part], order: tuple[str, ...], q: np.ndarray) -> Tree:
    """Place every body of a tree; `order` names the joints of q (..., n)."""
    n, shape = len(order), (*q.shape[:-1], len(parts), 3)
    R, p, centres = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
    Jw, Jp = np.zeros((*shape, 3 + n)), np.zeros((*shape, 3 + n))
    R[..., 0, :, :], Jw[..., 0, :, :3] = np.eye(3), np.eye(3)
    Jc = np.zeros_like(Jp)
    for k, part in enumerate(parts):
        if k:
            i, j = part.parent, order.index(part.joint)
            frame = R[..., i, :, :] @ to_rotation(part.rpy)
            axis, arm = frame @ part.axis, R[..., i, :, :] @ part.origin
            slides = part.kind == 'prismatic'
            R[..., k, :, :] = frame if slides else frame @ turn(part.axis, q[..., j])
            if slides:
                arm = arm + axis * q[..., j, None]
            p[..., k, :] = p[..., i, :] + arm
            Jp[..., k, :, :] = Jp[..., i, :, :] - _skew(arm) @ Jw[..., i, :, :]
            Jw[..., k, :, :] = Jw[..., i, :, :]
            (Jp if slides else Jw)[..., k, :, 3 + j] = axis
        arm = R[..., k, :, :] @ part.com
        centres[..., k, :] = p[..., k, :] + arm
        Jc[..., k, :, :] = Jp[..., k, :, :] - _skew(arm) @ Jw[..., k, :, :]
    return Tree(R, centres, Jw, Jc)


_SKEW = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0],
                  [0, -1, 0, 1, 0, 0, 0, 0, 0]])  # fmt: skip


def _skew(v: np.ndarray) -> np.ndarray:
    """(..., 3, 3) of v (..., 3)."""
    return (v @ _SKEW).reshape(*v.shape, 3)


def inertia_of(parts: list[Part], order: tuple[str, ...], q: np.ndarray) -> np.ndarray:
    """(..., 3 + n, 3 + n) inertia [[D, Dq], [Dq^T, Dqq]] with the centre of mass at rest."""
    return _inertia(parts, place(parts, order, q))


def _inertia(parts: list[Part], tree: Tree) -> np.ndarray:
    mass = np.array([part.mass for part in parts])
    mean = np.einsum('k,...kai->...ai', mass, tree.linear) / mass.sum()
    total = np.zeros(mean.shape[:-2] + (mean.shape[-1],) * 2)
    for k, part in enumerate(parts):
        R, turning = tree.rotations[..., k, :, :], tree.angular[..., k, :, :]
        slip = tree.linear[..., k, :, :] - mean
        total += _t(turning) @ (R @ part.inertia @ _t(R)) @ turning + part.mass * _t(slip) @ slip
    return total


def _t(matrices: np.ndarray) -> np.ndarray:
    return np.swapaxes(matrices, -1, -2)


def carried(parts: list[Part], order: tuple[str, ...], q: np.ndarray, body: int) -> np.ndarray:
    """(..., 3, 3) rotation of a body to base axes."""
    return place(parts, order, q).rotations[..., body, :, :]


def joint_names(parts: list[Part]) -> tuple[str, ...]:
    """Joints in the order of the parts."""
    return tuple(part.joint for part in parts[1:])


def table_two(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions and rates (N, 3) of Table II at times t (N,), again from rest every 20 s."""
    t = np.mod(np.atleast_1d(np.asarray(t, dtype=float)), PERIOD)[:, None, None]
    w = 2.0 * np.pi / PERIOD * np.arange(1, 4)
    a, b = np.array(_SINE), np.array(_COSINE)
    poly = _closing()
    powers = np.arange(6)
    q = np.sum(a / w * np.sin(w * t) - b / w * np.cos(w * t), axis=2)
    qd = np.sum(a * np.cos(w * t) + b * np.sin(w * t), axis=2)
    t = t[..., 0]
    q += (t**powers) @ poly
    qd += (powers[1:] * t ** (powers[1:] - 1)) @ poly[1:]
    return q, qd


@cache
def _closing() -> np.ndarray:
    """(6, 3) polynomial that makes position, rate and acceleration zero at both ends."""
    T, a, b = PERIOD, np.array(_SINE), np.array(_COSINE)
    w = 2.0 * np.pi / T * np.arange(1, 4)
    ends = np.array([-np.sum(b / w, axis=1), np.sum(a, axis=1), np.sum(b * w, axis=1)])
    rows = [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, T, T**2, T**3, T**4, T**5],
        [0, 1, 2 * T, 3 * T**2, 4 * T**3, 5 * T**4],
        [0, 0, 2, 6 * T, 12 * T**2, 20 * T**3],
    ]
    return np.linalg.solve(np.array(rows, dtype=float), -np.vstack([ends, ends]))


@dataclass(frozen=True)
class Run:
    """A noise-free run at 100 Hz.

    Args:
        axes: Joint axes of the robot that moved.
        time: (N,). q, qd: (N, 3). omega: (N, 3). attitude_xyzw: (N, 4).
        momentum: (3,) total angular momentum, inertial frame.
    """

    axes: str
    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    omega: np.ndarray
    attitude_xyzw: np.ndarray
    momentum: np.ndarray


def still(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints at rest."""
    return np.zeros((np.size(t), 3)), np.zeros((np.size(t), 3))


def last_joint_only(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Table II on the third joint; the others rest."""
    q, qd = table_two(t)
    return q * [0.0, 0.0, 1.0], qd * [0.0, 0.0, 1.0]


def locked(t: np.ndarray, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Table II with one joint locked."""
    moves = np.arange(3) != joint
    q, qd = table_two(t)
    return q * moves, qd * moves


STOPS = -0.25, 0.3  # rad, limits of the second joint, which is thrown back there


def thrown_back(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Table II, the second joint reflected at its limits."""
    q, qd = table_two(t)
    low, way = STOPS[0], STOPS[1] - STOPS[0]
    beyond = np.mod(q[:, 1] - low, 2.0 * way) - way
    q[:, 1], qd[:, 1] = low + way - np.abs(beyond), -np.sign(beyond) * qd[:, 1]
    return q, qd


MOTIONS = {
    'thrown_back': thrown_back,
    'table_two': table_two,
    'still': still,
    'last_joint_only': last_joint_only,
    **{f'locked_{i + 1}': partial(locked, joint=i) for i in range(3)},
}


def simulate(axes: str, duration: float, motion: str = 'table_two') -> Run:
    """Run the robot of Table I, wheels as in Table I, from the initial state of the paper.

    Args:
        axes: Joint axes.
        duration: [s]; whole periods are simulated once.
        motion: A key of `MOTIONS`.
    """
    whole = _simulated(axes, math.ceil(duration / PERIOD), motion)
    count = round(100 * duration) + 1
    names = ('time', 'q', 'qd', 'omega', 'attitude_xyzw')
    return replace(whole, **{name: getattr(whole, name)[:count] for name in names})


@cache
def _simulated(axes: str, periods: int, motion: str) -> Run:
    parts = table_one(axes)
    order = joint_names(parts)
    moves = MOTIONS[motion]

    def base_rates(t: np.ndarray, to_base: np.ndarray, total: np.ndarray) -> np.ndarray:
        """Rates (N, 3) of the base at times t (N,), turned by to_base (N, 3, 3)."""
        q, qd = moves(t)
        tree = place(parts, order, q)
        M = _inertia(parts, tree)
        wheels = H_BASE + tree.rotations[:, 3] @ H_TARGET
        rest = to_base @ total - wheels - (M[:, :3, 3:] @ qd[..., None])[..., 0]
        return np.linalg.solve(M[:, :3, :3], rest[..., None])[..., 0]

    q0, qd0 = (x[0] for x in moves(np.zeros(1)))
    M0 = inertia_of(parts, order, q0)
    wheels0 = H_BASE + carried(parts, order, q0, 3) @ H_TARGET
    R0 = quaternion_matrix(ATTITUDE_XYZW)
    total = R0 @ (M0[:3, :3] @ OMEGA + M0[:3, 3:] @ qd0 + wheels0)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        unit = x / np.linalg.norm(x)
        w = base_rates(np.array([t]), quaternion_matrix(unit).T, total)[0]
        e, s = x[:3], x[3]
        return 0.5 * np.append(s * w + np.cross(e, w), -e @ w)

    time = np.arange(round(100 * periods * PERIOD) + 1) / 100.0
    attitude = np.empty((len(time), 4))
    attitude[0] = ATTITUDE_XYZW
    if periods > 1:
        before = _simulated(axes, periods - 1, motion).attitude_xyzw
        attitude[: len(before)] = before
    # each period begins with a step of the jerk, where the integrator must stop
    a, b = (periods - 1) * PERIOD, periods * PERIOD
    last = slice(round(100 * a), None)
    solution = solve_ivp(
        rate, (a, b), attitude[last][0], method='DOP853', t_eval=time[last], rtol=1e-11, atol=1e-12
    )
    attitude[last] = solution.y.T
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    to_base = np.array([quaternion_matrix(r).T for r in attitude])
    omega = base_rates(time, to_base, total)
    q, qd = moves(time)
    return Run(axes, time, q, qd, omega, attitude, total)


def measure(
    run: Run,
    seed: int,
    scale: float = 1.0,
    joint_every: int = 1,
    rate_every: int = 1,
    attitude_every: int = 10,
) -> Record:
    """Sample a run, noise `STDS` times a scale, each sensor at its own divisor of 100 Hz."""
    rng = np.random.default_rng(seed)
    j, g, a = (np.arange(0, len(run.time), k) for k in (joint_every, rate_every, attitude_every))
    s = {name: scale * value for name, value in STDS.items()}
    q = run.q[j] + s['joint_position_std'] * rng.standard_normal((len(j), 3))
    qd = run.qd[j] + s['joint_velocity_std'] * rng.standard_normal((len(j), 3))
    omega = run.omega[g] + s['gyro_std'] * rng.standard_normal((len(g), 3))
    small = Rotation.from_rotvec(s['attitude_std'] * rng.standard_normal((len(a), 3)))
    attitude = (Rotation.from_quat(run.attitude_xyzw[a]) * small).as_quat()
    return _record(
        joint_time=run.time[j],
        q=q,
        qd=qd,
        rate_time=run.time[g],
        omega=omega,
        attitude_time=run.time[a],
        attitude_xyzw=attitude,
    )


def changed(record: Record, **views) -> Record:
    """The record with other values of its flat views, such as `omega`."""
    names = ('joint_time', 'q', 'qd', 'rate_time', 'omega', 'attitude_time', 'attitude_xyzw')
    return _record(**{**{name: getattr(record, name) for name in names}, **views})


def _record(joint_time, q, qd, rate_time, omega, attitude_time, attitude_xyzw) -> Record:
    stamps = [to_stamps(time, ORIGIN_NS) for time in (joint_time, rate_time, attitude_time)]
    return Record(
        JointSeries(('j_link_1', 'j_link_2', 'j_link_3'), stamps[0], q, qd) if len(q) else None,
        RateSeries(stamps[1], omega) if len(omega) else None,
        AttitudeSeries(stamps[2], attitude_xyzw) if len(attitude_time) else None,
        source='test',
        zero_ns=ORIGIN_NS,
    )


def truth_of(run: Run, structure: str = 'symmetric') -> np.ndarray:
    """The constants [h_W; AAM; x] of a run; x by the grouping of the product's minimal set."""
    return np.concatenate([run.momentum, H_TARGET, _minimal_truth(run.axes, structure)])


@cache
def _minimal_truth(axes: str, structure: str) -> np.ndarray:
    robot = robot_of(table_one(axes))
    return minimal_set(robot, structure).of_robot(robot)


def errors_of(estimate: Estimate, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors of [h_W; AAM; x] and the standard deviations that the estimate states."""
    value = np.concatenate([estimate.total_momentum, estimate.aam, estimate.parameters])
    momentum_std = np.sqrt(np.diag(estimate.total_momentum_covariance))
    return value - truth, np.concatenate([momentum_std, estimate.std])
