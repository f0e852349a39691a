"""Wheel momentum of robots that nobody designed, against MuJoCo's truth.

Drawn chains of two to seven joints with oblique axes, one of which slides in every sixth, on a
free base; the last link carries a client with wheels that the robot file believes at rest. MuJoCo
moves them for 40 s along band-limited references; nothing acts from outside. The robot file is
right, or every body's mass, centre (in radii of gyration) and factor of second moments were drawn
about it with a standard deviation of 0.1 or 0.3.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.recording.record import (
    AttitudeSeries,
    JointSeries,
    RateSeries,
    Record,
    to_stamps,
)
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, key
from ..replay.machines import NOISE, Machine, _drawn, _urdf, own_bodies
from ..replay.plant import STEP, Body, Motion, Plant, about

_SECONDS, _RATE = 40.0, 100.0
_OFF = (0.0, 0.1, 0.3)
_FIRST = 5000  # seed with which nothing was tuned
_SLIDES, _TURNS = (0.2, 0.08), (1.0, 0.5)  # of q0, and [m] or [rad] of the motion
_GOOD = 1.0  # error of the momentum [%]


def trials(runs: int, is_quick: bool) -> list[str]:
    """One flight each, the file off by nothing, by 0.1 and by 0.3 in turn."""
    return [key(_FIRST + k, _OFF[k % len(_OFF)]) for k in range(runs)]


def drawn(seed: int) -> tuple[Machine, np.random.Generator]:
    """A robot with its true momenta, and where the random numbers go on."""
    rng = np.random.default_rng((seed, 4711))
    n = 2 + seed % 6
    slide = int(rng.integers(n)) if (seed // 6 + seed) % 6 == 5 else -1
    rows = [_drawn(rng, rng.uniform(100.0, 400.0), 1.2)]
    axes, places = np.zeros((2, n, 3))
    for k in range(n):
        axes[k] = rng.standard_normal(3)
        reach = np.array([0.5, 0.3, 0.2]) if k == 0 else 0.4
        places[k] = reach * rng.uniform(-1.0, 1.0, 3)
        is_client = k == n - 1
        mass = rng.uniform(40.0, 120.0) if is_client else rng.uniform(2.0, 15.0)
        rows.append(_drawn(rng, mass, 0.8 if is_client else 0.25))
    way = rng.standard_normal(3)
    momentum = rng.uniform(0.5, 5.0) * way / np.linalg.norm(way)
    return Machine(
        _urdf(rows, axes, places, slide),
        tuple(f'j{k}' for k in range(1, n + 1)),
        *('b0', True, np.zeros(n)),
        wheels=rng.uniform(-3.0, 3.0, 3),
        target=f'b{n}',
        momentum=momentum,
    ), rng


def _off(b: Body, share: float, rng: np.random.Generator) -> Body:
    """Another body, a share of whose standard deviations is one of the file's."""
    z = share * rng.standard_normal(10)
    inertia = b.inertia - b.mass * about(b.com)
    factor = np.linalg.cholesky(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    size = np.sum(factor**2)
    factor[np.arange(3), np.arange(3)] *= np.exp(z[4:7])
    factor[[1, 2, 2], [0, 0, 1]] += np.sqrt(size / 3.0) * z[7:]
    moments = factor @ factor.T
    out = Body(b.parent, b.pos, b.rpy, 0.0, np.zeros(3), np.zeros((3, 3)), b.joint)
    com = b.com + np.sqrt(size / b.mass) * z[1:4]
    out.add(b.mass * np.exp(z[0]), com, np.trace(moments) * np.eye(3) - moments)
    return out


def _fly(plant: Plant, rng: np.random.Generator) -> list[Array]:
    """Clean samples at 100 Hz: q, qd, omega, attitude xyzw."""
    motion = Motion(plant)
    model, data, n = motion.model, motion.data, len(plant.joints)
    kinds = [plant.joint(name)['type'] for name in plant.joints]
    start, size = np.array([_SLIDES if kind == 'slide' else _TURNS for kind in kinds]).T
    data.qpos[motion.q] = q0 = rng.uniform(-0.5, 0.5, n) * start
    data.qvel[3:6] = rng.uniform(-0.02, 0.02, 3)
    rates = 2.0 * np.pi * rng.uniform(0.02, 0.15, (n, 5))
    a = rng.standard_normal((n, 5)) * size[:, None] / np.sqrt(5.0)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    inertia = 1.0 / np.diag(np.linalg.inv(full))[motion.v]

    def torque() -> Array:
        part = min(data.time / 4.0, 1.0)
        wave, slope = np.sin(rates * data.time), rates * np.cos(rates * data.time)
        q, qd = part**2 * (3.0 - 2.0 * part) * np.sum([a * wave, a * slope], axis=2)
        ahead = q0 + q - data.qpos[motion.q]
        return inertia * (16.0 * ahead + 8.0 * (qd - data.qvel[motion.v]))

    motion.torque = torque
    rows = []
    mujoco.set_mjcb_passive(motion.stage)
    try:
        for _ in range(round(_SECONDS * _RATE) + 1):
            parts = (data.qpos[motion.q], data.qvel[motion.v], data.qvel[3:6])
            rows.append(np.concatenate([*parts, data.qpos[[4, 5, 6, 3]]]))
            mujoco.mj_step(model, data, nstep=round(1.0 / (_RATE * STEP)))
    finally:
        mujoco.set_mjcb_passive(None)
    return np.split(np.array(rows), np.cumsum([n, n, 3]), axis=1)


def run(key: str) -> TrialRecord:
    """One flight, flown and identified."""
    seed, off = json.loads(key)
    machine, rng = drawn(seed)
    bodies = own_bodies(machine)
    if off:
        bodies = {name: _off(b, off, rng) for name, b in bodies.items()}
    *rates, xyzw = _fly(machine.plant(bodies, ()), rng)
    stds = (NOISE[name] for name in ('position', 'velocity', 'gyro'))
    q, qd, omega = (
        x + std * rng.standard_normal(x.shape) for x, std in zip(rates, stds, strict=True)
    )
    every = round(_RATE / (10.0 if seed % 2 else 2.0))
    tracked = Rotation.from_quat(xyzw[::every])
    turned = tracked * Rotation.from_rotvec(
        NOISE['attitude'] * rng.standard_normal((len(tracked), 3))
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'robot.yaml')
        path.with_suffix('.urdf').write_text(machine.urdf, encoding='utf-8')
        path.write_text(replace(machine, momentum=np.zeros(3)).yaml(), encoding='utf-8')
        file = load_robot_file(path)
    stamps = to_stamps(np.arange(len(q)) / _RATE)
    record = Record(
        joints=JointSeries(file.robot.joints, stamps, q, qd, None),
        rates=RateSeries(stamps, omega),
        attitudes=AttitudeSeries(stamps[::every], turned.as_quat()),
    )
    begun = time.process_time()
    estimate = identify(record, file.robot, file.settings.identifier, 'ml').estimate
    size, error = np.linalg.norm(machine.momentum), estimate.aam - machine.momentum
    return {
        'seed': seed,
        'off': off,
        'joints': len(machine.joints),
        'slides': any(b.joint.get('type') == 'slide' for b in bodies.values()),
        **{name: getattr(estimate, name) for name in ('valid', 'reason', 'rank', 'unknowns')},
        'error_percent': 100.0 * float(np.linalg.norm(error) / size),
        'z': (error / estimate.std[:3]).tolist(),
        'std_percent': 100.0 * float(np.max(estimate.std[:3]) / size),
        'chi2': estimate.chi2_per_dof,
        'factor': estimate.prior_factor,
        'cpu_s': time.process_time() - begun,
    }


def results(records: Sequence[TrialRecord]) -> Results:
    """As `momentum_flights`: by what the file is off by, and of all."""
    groups = {f'{off:g}': [r for r in records if r['off'] == off] for off in _OFF}
    groups['all'] = list(records)
    return {'momentum_flights': {name: _score(own) for name, own in groups.items() if own}}


def _score(records: Sequence[TrialRecord]) -> TrialRecord:
    z, errors = (np.array([r[name] for r in records]) for name in ('z', 'error_percent'))
    return {
        'flights': len(records),
        'valid': sum(r['valid'] for r in records),
        'good': int(np.sum(errors < _GOOD)),
        'median': float(np.median(errors)),
        'z_rms': float(np.sqrt(np.mean(z**2))),
        'z_worst': float(np.max(np.abs(z))),
    }


def shown(results: Results) -> Results:
    """With shares of all flights."""
    s = results['momentum_flights']['all']
    return {**results, 'all': s | {n: s[n] / s['flights'] for n in ('valid', 'good')}}
