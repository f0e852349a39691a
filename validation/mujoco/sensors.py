"""Samples a truth run: rates, delays, faults, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

from ..replay.machines import NOISE
from .plan import Plan
from .run import History

RATES = {'q': 100.0, 'qd': 100.0, 'tau': 100.0, 'omega': 100.0, 'attitude': 10.0}
"""Of samples by channel [Hz]."""
_FILE = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
Samples = dict[str, np.ndarray]
"""By channel; attitudes as rotation matrices."""


@dataclass(frozen=True)
class Sensors:
    """What of sensors differs.

    Args:
        effort_std: Of torques [N m].
        effort_mean: Held torques are read as their mean about the stamp (half a period to each
            side); False: as the torque of the period that ended at the stamp.
    """

    effort_std: float = 0.05
    effort_mean: bool = True

    @property
    def stds(self) -> dict[str, float]:
        """Standard deviations a sample as a robot file has them, in the order of `RATES`."""
        stds = NOISE | {'effort': self.effort_std}
        return {f'{name}_std': stds[name.removeprefix('joint_')] for name in _FILE}


def noise_of(sensors: Sensors, seed: int, n: int, duration: float, on: bool) -> Samples:
    """One seeded stream a channel; samples keep their noise whatever else is switched."""
    widths = zip(RATES.items(), (n, n, n, 3, 3), sensors.stds.values(), strict=True)
    return {
        name: std * on * stream(seed, k).standard_normal((round(rate * duration) + 1, width))
        for k, ((name, rate), width, std) in enumerate(widths)
    }


def stream(seed: int, place: int) -> np.random.Generator:
    """A random stream of its own."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(place,)))


def sample(
    plan: Plan, history: History, noise: Samples, held: float | None, mean: bool
) -> tuple[Samples, Samples]:
    """Sample times and values by channel.

    Args:
        plan: Delays and sensor faults.
        history: The truth.
        noise: Drawn before, as the controller may have seen it.
        held: Control period of held torques [s]; None where they are smooth.
        mean: `Sensors.effort_mean`.
    """
    end = history.time[-1] + 1e-9
    times = {name: np.arange(math.floor(end * rate) + 1) / rate for name, rate in RATES.items()}
    out = _clean(plan, history, times, held, mean)
    for mend in plan.mends:
        mend(out)
    errors = {name: error[: len(times[name])] for name, error in noise.items()}
    turned = out.pop('attitude') @ Rotation.from_rotvec(errors['attitude']).as_matrix()
    return times, {**{name: x + errors[name] for name, x in out.items()}, 'attitude': turned}


def _clean(
    plan: Plan, history: History, times: Samples, held: float | None, mean: bool
) -> Samples:
    """What perfect sensors would say, each as late as it is."""

    def late(at: np.ndarray, clock: str) -> np.ndarray:
        return np.maximum(at - plan.delays.get(clock, 0.0), 0.0)

    on_motor = np.array([j in plan.encoder_on_motor for j in plan.joints])
    t, joints = history.time, late(times['q'], 'joints')
    q = np.where(on_motor, history.motor_q, history.q)
    qd = np.where(on_motor, history.motor_qd, history.qd)
    wxyz = CubicSpline(t, history.attitude)(late(times['attitude'], 'attitude'))
    return {
        'q': CubicSpline(t, q)(joints),
        'qd': CubicSpline(t, qd)(joints),
        'tau': _effort(history, late(joints, 'effort'), held, mean),
        'omega': CubicSpline(t, history.omega)(late(times['omega'], 'imu')),
        'attitude': Rotation.from_quat(np.roll(wxyz, -1, axis=1)).as_matrix(),
    }


def _effort(history: History, at: np.ndarray, held: float | None, mean: bool) -> np.ndarray:
    """Motor torque at the sample times; the log holds the torque that ended at each step."""
    t, tau = history.time, history.torque
    if held is None:
        return CubicSpline(t, tau)(at)
    if not mean:
        return tau[np.clip(np.searchsorted(t, at - 1e-9), 0, len(t) - 1)]
    steps = np.diff(t)[:, None]
    integral = np.vstack([np.zeros((1, tau.shape[1])), np.cumsum(tau[1:] * steps, axis=0)])
    ends = [np.clip(at + part * held, 0, t[-1]) for part in (0.5, -0.5)]
    stop, begin = (np.column_stack([np.interp(x, t, c) for c in integral.T]) for x in ends)
    return (stop - begin) / (ends[0] - ends[1])[:, None]


def to_record(plan: Plan, times: Samples, samples: Samples, source: str) -> Record:
    """The record; a fixed base has joints only."""
    ns = {name: np.round(t * 1e9).astype(np.int64) for name, t in times.items()}
    columns = (samples[name] for name in ('q', 'qd', 'tau'))
    joints = JointSeries(tuple(plan.joints), ns['q'], *columns)
    if not plan.free:
        return Record(joints, source=source)
    attitude = Rotation.from_matrix(samples['attitude']).as_quat()
    rates = RateSeries(ns['omega'], samples['omega'])
    return Record(joints, rates, AttitudeSeries(ns['attitude'], attitude), source=source)


def write_bag(record: Record, path: Path, base_link: str) -> Path:
    """The record as a rosbag2 folder on the standard topics."""
    with BagWriter(path) as bag:
        j, compose = record.joints, bag.compose
        for ns, *columns in zip(
            j.stamp_ns.tolist(), j.position, j.velocity, j.effort, strict=True
        ):
            bag.add('/joint_states', compose.joint_state(ns, j.names, *columns))
        if record.rates is not None:
            for ns, omega in zip(record.rates.stamp_ns.tolist(), record.rates.omega, strict=True):
                bag.add('/imu/data', compose.imu(ns, base_link, omega))
        if (a := record.attitudes) is not None:
            for ns, q in zip(a.stamp_ns.tolist(), a.q_xyzw, strict=True):
                bag.add('/attitude', compose.quaternion(ns, q))
    return path
