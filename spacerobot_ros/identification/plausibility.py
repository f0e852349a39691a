r"""Data that are not what they should be, found and named before anyone trusts a number.

Gyro and star tracker must tell the same turns, joint rates and positions the same moves; where
they don't and a usual mistake (another quaternion convention, degrees, swapped columns) makes them
agree, that mistake is named. Joint columns that are swapped in positions and rates alike only
break the momentum equation: exchanging two must then make it hold.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics, accumulated_rotation
from ..estimation.smoothing import SensorData
from ..types import Array

_WINDOW = 0.5  # s; over which turns and moves are compared
_DISAGREES = 0.5  # of the larger signal; noise and sampling stay far below
_AGREES = 0.2  # of the disagreement, what a named mistake must reach
_SIGNAL = 3e-3  # rad in a window; smaller motions are left alone
_ROWS = 200  # times at which momentum is compared
_DEGREE = np.pi / 180.0


def sensor_faults(data: SensorData, joints: tuple[str, ...]) -> tuple[str, ...]:
    """What is wrong with the sensors, one line each; empty where nothing is.

    Args:
        data: Samples.
        joints: Names of the joints.
    """
    return (*_gyro_or_attitude(data), *_joint_columns(data, joints))


def swapped_joints(
    model: MomentumModel, reference: Kinematics, joints: tuple[str, ...]
) -> tuple[str, ...]:
    """The pair of joints whose exchange makes momentum hold, in a line; empty where none does."""
    step = max(1, len(reference.time) // _ROWS)
    sparse = Kinematics(
        reference.time[::step],
        reference.q[::step],
        reference.qd[::step],
        reference.omega[::step],
        reference.rotation[::step],
    )
    as_given = _momentum_misfit(model, sparse)
    misfits = {}
    for a, b in combinations(range(model.n), 2):
        order = list(range(model.n))
        order[a], order[b] = b, a
        exchanged = replace(sparse, q=sparse.q[:, order], qd=sparse.qd[:, order])
        misfits[joints[a], joints[b]] = _momentum_misfit(model, exchanged)
    if not misfits:
        return ()
    pair = min(misfits, key=lambda names: misfits[names])
    if misfits[pair] < 2.0 * _AGREES * as_given:
        return (f'the columns of {pair[0]} and {pair[1]} seem to be swapped',)
    return ()


def _momentum_misfit(model: MomentumModel, reference: Kinematics) -> float:
    columns, h0 = model.regressor(reference)
    rows, right = columns.reshape(-1, model.size), h0.ravel()
    norms = np.linalg.norm(rows, axis=0)
    unit = rows / np.where(norms > 0.0, norms, 1.0)
    if not np.any(right):  # wheels at rest: the smallest singular value of the homogeneous system
        return float(np.linalg.svd(unit[:, norms > 0.0], compute_uv=False)[-1])
    solution = np.linalg.lstsq(unit, right, rcond=1e-12)[0]
    return float(np.linalg.norm(unit @ solution - right))


def _gyro_or_attitude(data: SensorData) -> tuple[str, ...]:
    time = _windows(data.attitude_time, data.rate_time)
    if len(time) < 3:
        return ()
    q = data.attitude_xyzw[np.searchsorted(data.attitude_time, time)]
    attitudes = {
        '': q,
        'the quaternions seem to be scalar first (w x y z)': q[:, [1, 2, 3, 0]],
        'the quaternions seem to be inverse (inertial to base)': q * [-1.0, -1.0, -1.0, 1.0],
        'the quaternions seem to be scalar first and inverse': q[:, [1, 2, 3, 0]]
        * [-1.0, -1.0, -1.0, 1.0],
    }
    gyros = {
        '': 1.0,
        'the gyro seems to be in deg/s': _DEGREE,
        'the gyro seems to have the wrong sign': -1.0,
    }
    pairs = _covered(time, data.rate_time)
    at = np.searchsorted(data.rate_time, time)
    turned = {other: _turns(data, factor, at)[pairs] for other, factor in gyros.items()}
    misfits = {}
    for name, quaternions in attitudes.items():
        rotation = Rotation.from_quat(quaternions)
        seen = (rotation[:-1].inv() * rotation[1:]).as_rotvec()[pairs]
        for other in gyros:
            if not name or not other:
                misfits[name or other] = _disagreement(seen, turned[other])
    rotation = Rotation.from_quat(q)
    seen = (rotation[1:] * rotation[:-1].inv()).as_rotvec()[pairs]
    misfits['the gyro seems to be in the inertial frame'] = _disagreement(
        seen, -_turns(data, -1.0, at)[pairs]
    )
    return _named(misfits, 'gyro and attitude do not belong together')


def _joint_columns(data: SensorData, joints: tuple[str, ...]) -> tuple[str, ...]:
    if not np.all(np.isfinite(data.qd)) or len(data.joint_time) < 5:
        return ()
    time = _windows(data.joint_time, data.joint_time)
    pairs = _covered(time, data.joint_time)
    at = np.searchsorted(data.joint_time, time)
    moved = np.diff(data.q[at], axis=0)[pairs]
    rated = np.diff(_integral(data.joint_time, data.qd)[at], axis=0)[pairs]
    misfits = {
        '': _disagreement(moved, rated),
        'the joint rates seem to be in deg/s': _disagreement(moved, _DEGREE * rated),
        'the joint positions seem to be in degrees': _disagreement(_DEGREE * moved, rated),
    }
    for a, b in combinations(range(len(joints)), 2):
        order = list(range(len(joints)))
        order[a], order[b] = b, a
        name = f'the rates (or positions) of {joints[a]} and {joints[b]} seem to be swapped'
        misfits[name] = _disagreement(moved, rated[:, order])
    return _named(misfits, 'joint positions and rates do not belong together')


def _named(misfits: dict[str, float], otherwise: str) -> tuple[str, ...]:
    """The mistake that explains the misfit of '', if that is large."""
    if misfits[''] < _DISAGREES:
        return ()
    best = min(misfits, key=lambda name: misfits[name])
    return (best if best and misfits[best] < _AGREES * misfits[''] else otherwise,)


def _disagreement(one: Array, other: Array) -> float:
    """Rms of the difference over that of the larger; zero for motions too small to compare."""
    if not len(one):
        return 0.0
    sizes = [float(np.sqrt(np.mean(np.sum(x**2, axis=1)))) for x in (one, other)]
    if max(sizes) < _SIGNAL:
        return 0.0
    return float(np.sqrt(np.mean(np.sum((one - other) ** 2, axis=1)))) / max(sizes)


def _windows(stamps: Array, covered: Array) -> Array:
    """Some of the stamps, at least a window apart and within the other sensor's samples."""
    inside = stamps[(stamps >= covered[0]) & (stamps <= covered[-1])] if len(covered) > 1 else []
    chosen: list[float] = []
    for t in inside:
        if not chosen or t - chosen[-1] >= _WINDOW - 1e-9:
            chosen.append(float(t))
    return np.array(chosen)


def _covered(time: Array, stamps: Array) -> np.ndarray:
    """(N-1,) whether each window is short and free of gaps in the sensor to integrate."""
    gaps = np.diff(stamps)
    usual = 3.0 * float(np.median(gaps))
    wide = np.concatenate([[0], np.cumsum(gaps > usual)])
    count = wide[np.searchsorted(stamps, time, side='right') - 1]
    return (np.diff(time) <= 4.0 * _WINDOW) & (np.diff(count) == 0)


def _integral(stamps: Array, values: Array) -> Array:
    """(N, m) integral of samples from the first to each, by trapezoids."""
    steps = 0.5 * np.diff(stamps)[:, None] * (values[1:] + values[:-1])
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])


def _turns(data: SensorData, factor: float, at: np.ndarray) -> Array:
    """(N-1, 3) rotation vectors of the gyro's turns between its samples `at` (N,)."""
    steps = np.diff(_integral(data.rate_time, factor * data.omega), axis=0)
    turned = accumulated_rotation(Rotation.identity(), steps)
    # attitudes between two gyro samples count at the later one
    part = turned[np.minimum(at, len(data.rate_time) - 1)]
    return np.asarray((part[:-1].inv() * part[1:]).as_rotvec())
