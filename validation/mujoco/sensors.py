"""Samples a truth run: rates, delays, faults, noise, dropouts, jitter, quantisation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

from .plan import Plan
from .run import History

CHANNELS = ('q', 'qd', 'tau', 'omega', 'attitude')


@dataclass(frozen=True)
class Sensors:
    """Standard deviations a sample, rates [Hz], and what else is not perfect.

    Args:
        position_std: [rad]. velocity_std: [rad/s]. effort_std: [N m]. gyro_std: [rad/s].
        attitude_std: [rad].
        joint_rate: [Hz]. imu_rate: [Hz]. attitude_rate: [Hz].
        dropout: Fraction of samples that never arrive.
        jitter: Standard deviation of a stamp against its sample [s].
        position_step: Quantisation of the encoders [rad].
        effort_mean: Held torques are read as their mean about the stamp (half a period to each
            side); False: as the torque of the period that ended at the stamp.
    """

    position_std: float = 2e-5
    velocity_std: float = 2e-4
    effort_std: float = 0.05
    gyro_std: float = 2e-5
    attitude_std: float = 3e-5
    joint_rate: float = 100.0
    imu_rate: float = 100.0
    attitude_rate: float = 10.0
    dropout: float = 0.0
    jitter: float = 0.0
    position_step: float = 0.0
    effort_mean: bool = True

    @property
    def rates(self) -> dict[str, float]:
        """By channel [Hz]."""
        joints = dict.fromkeys(CHANNELS[:3], self.joint_rate)
        return joints | {'omega': self.imu_rate, 'attitude': self.attitude_rate}

    @property
    def stds(self) -> dict[str, float]:
        """As a robot file has them, in the order of the channels."""
        names = ('position', 'velocity', 'effort', 'gyro', 'attitude')
        files = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
        return {f'{f}_std': getattr(self, f'{n}_std') for f, n in zip(files, names, strict=True)}


def noise_of(
    sensors: Sensors, seed: int, n: int, duration: float, on: bool
) -> dict[str, np.ndarray]:
    """One seeded stream a channel; samples keep their noise whatever else is switched."""
    rates, stds = sensors.rates, sensors.stds.values()
    counts = zip(CHANNELS, (n, n, n, 3, 3), stds, strict=True)
    return {
        c: std * on * stream(seed, k).standard_normal((round(rates[c] * duration) + 1, width))
        for k, (c, width, std) in enumerate(counts)
    }


def stream(seed: int, place: int) -> np.random.Generator:
    """A random stream of its own."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(place,)))


def sample(
    plan: Plan,
    history: History,
    sensors: Sensors,
    noise: dict[str, np.ndarray],
    held: float | None,
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Sample times and values by channel; attitude as rotation matrices.

    Args:
        plan: Delays and sensor faults.
        history: The truth.
        sensors: Rates and imperfections.
        noise: Drawn before, as the controller may have seen it.
        held: Control period of held torques [s]; None where they are smooth.
    """
    end = history.time[-1] + 1e-9
    times = {
        name: np.arange(math.floor(end * rate) + 1) / rate for name, rate in sensors.rates.items()
    }
    clean = _clean(plan, history, times, held, sensors.effort_mean)
    for mend in plan.mends:
        mend(clean)
    out = {}
    for name in CHANNELS:
        error = noise[name][: len(times[name])]
        if name == 'attitude':
            values = clean[name] @ Rotation.from_rotvec(error).as_matrix()
        else:
            values = clean[name] + error
        out[name] = (times[name], values)
    if sensors.position_step:
        t, q = out['q']
        out['q'] = (t, sensors.position_step * np.round(q / sensors.position_step))
    return out


def _clean(
    plan: Plan,
    history: History,
    times: dict[str, np.ndarray],
    held: float | None,
    mean: bool,
) -> dict[str, np.ndarray]:
    """What perfect sensors would say, each as late as it is."""
    late = plan.delays
    joints = np.maximum(times['q'] - late.get('joints', 0.0), 0.0)
    effort = np.maximum(joints - late.get('effort', 0.0), 0.0)
    imu = np.maximum(times['omega'] - late.get('imu', 0.0), 0.0)
    attitude = np.maximum(times['attitude'] - late.get('attitude', 0.0), 0.0)
    on_motor = np.array([j in plan.encoder_on_motor for j in plan.joints])
    t = history.time
    q = np.where(on_motor, history.motor_q, history.q)
    qd = np.where(on_motor, history.motor_qd, history.qd)
    wxyz = CubicSpline(t, history.attitude)(attitude)
    return {
        'q': CubicSpline(t, q)(joints),
        'qd': CubicSpline(t, qd)(joints),
        'tau': _effort(history, effort, held, mean),
        'omega': CubicSpline(t, history.omega)(imu),
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
    begin, stop = np.clip(at - 0.5 * held, 0, t[-1]), np.clip(at + 0.5 * held, 0, t[-1])
    between = [
        np.column_stack([np.interp(x, t, column) for column in integral.T]) for x in (stop, begin)
    ]
    return (between[0] - between[1]) / (stop - begin)[:, None]


def to_record(
    plan: Plan,
    samples: dict[str, tuple[np.ndarray, np.ndarray]],
    sensors: Sensors,
    seed: int,
    source: str,
) -> Record:
    """The record, with dropouts and jitter; a fixed base has joints only."""

    def stamps(place: int, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rng = stream(seed, 10 + place)
        late = t + sensors.jitter * rng.standard_normal(len(t))
        ns = np.round(late * 1e9).astype(np.int64)
        kept = rng.random(len(t)) >= sensors.dropout
        kept[1:] &= np.diff(np.maximum.accumulate(ns)) > 0
        return ns[kept], kept

    ns, kept = stamps(0, samples['q'][0])
    columns = [samples[name][1][kept] for name in CHANNELS[:3]]
    joints = JointSeries(tuple(plan.joints), ns, *columns)
    if not plan.free:
        return Record(joints, source=source)
    ns, kept = stamps(1, samples['omega'][0])
    rates = RateSeries(ns, samples['omega'][1][kept])
    ns, kept = stamps(2, samples['attitude'][0])
    attitude = Rotation.from_matrix(samples['attitude'][1][kept]).as_quat()
    return Record(joints, rates, AttitudeSeries(ns, attitude), source=source)


def write_bag(record: Record, path: Path, base_link: str) -> Path:
    """The record as a rosbag2 folder on the standard topics."""
    with BagWriter(path) as bag:
        j, compose = record.joints, bag.compose
        for k, ns in enumerate(j.stamp_ns.tolist()):
            columns = (j.position[k], j.velocity[k], j.effort[k])
            bag.add('/joint_states', compose.joint_state(ns, j.names, *columns))
        if record.rates is not None:
            for ns, omega in zip(record.rates.stamp_ns.tolist(), record.rates.omega, strict=True):
                bag.add('/imu/data', compose.imu(ns, base_link, omega))
        if record.attitudes is not None:
            a = record.attitudes
            for ns, q in zip(a.stamp_ns.tolist(), a.q_xyzw, strict=True):
                bag.add('/attitude', compose.quaternion(ns, q))
    return path
