"""Records of the replay: simulated from their line in `records.jsonl`, kept outside git, checked.

A line says machine, seed, motion, what is hidden with its sizes, and what is asked. Nothing may
change here, nor in `plant.py`, `effects.py` and `machines.py`: `samples.json` has a few samples of
every record, and a record that differs from them by more than 1e-9 of its channel is refused.

Sizes are numbers, so that a blunter engine gets no easier exam. They were drawn once by the engine
of 0b820b9, `times_limit` its detection limits: of a flight by `diagnosis_draw.drawn` on the record
in which nothing is hidden, of an arm by the choice that its `diagnose` or `compare` makes there.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfiltfilt
from scipy.spatial.transform import Rotation

from .effects import Hidden
from .machines import NOISE, Array, Machine, machine, off, own_bodies
from .plant import STEP, Motion, Plant

HERE = Path(__file__).parent
RATE, TRACKER, FLIGHT, ARM = 100.0, 10.0, 20.0, 24.0  # Hz, Hz, s, s
MOTIONS = {'default': (0.3, 2, 4), 'fast': (0.6, 5, 8), 'slow': (0.3, 1, 2), 'long': (0.5, 1, 3)}
_TOLERANCE = 1e-9
_CHECKED = 7  # samples of every channel
# what no cause is, of an arm; shares of the Coulomb torque where not said otherwise
_WANDER = {8.0: 0.04, 1.0: 0.04, 0.3: 0.04}  # by its memory [s]
_BY_RUN, _DRIFT, _TEETH, _RIPPLE = 0.04, 0.04, 200, 0.03
_BODY, _GAIN, _EFFORT, _CREEP, _FILTER = 0.03, 0.02, 5e-3, 2e-3, 20.0  # rad/s; Hz
Samples = dict[str, Array]


class ChangedRecordError(Exception):
    """A generator that does not make the record that it made."""


def table() -> list[dict[str, Any]]:
    """Every line of `records.jsonl`."""
    text = (HERE / 'records.jsonl').read_text(encoding='utf-8')
    return [json.loads(line) for line in text.splitlines()]


def hidden_of(line: Mapping[str, Any]) -> Hidden:
    """(id, where, values) of what a line hides."""
    return [(h['effect'], h['where'], h['values']) for h in line.get('hidden', ())]


def made(line: Mapping[str, Any], folder: Path) -> Path:
    """The folder of a line's record, as `simulate` has it, checked.

    Raises:
        ChangedRecordError: it is not the record whose samples are stored.
    """
    own = simulate(line, folder)
    check(line['key'], own)
    return own


def simulate(line: Mapping[str, Any], folder: Path) -> Path:
    """The folder of a line's record, simulated where it is not there yet.

    It has `robot.yaml`, `robot.urdf`, `map.yaml` and `data.npz`; `before.npz` of a comparison.
    """
    own = folder / line['key']
    if not (own / 'data.npz').exists():
        m = machine(line['machine'], line['seed'])
        own.mkdir(parents=True, exist_ok=True)
        for name, text in (
            ('robot.yaml', m.yaml()),
            ('robot.urdf', m.urdf),
            ('map.yaml', _map(m)),
        ):
            (own / name).write_text(text, encoding='utf-8')
        for name, run, hidden in _runs(line):
            part = own / f'{name}.part'  # whole, or not there
            with part.open('wb') as file:
                np.savez(file, **simulated(line, run, hidden))
            part.rename(own / f'{name}.npz')
    return own


def _runs(line: Mapping[str, Any]) -> Iterator[tuple[str, int, Hidden]]:
    if line['asked'] == 'compare':
        yield 'before', 1, ()
    yield 'data', 0, hidden_of(line)


def check(key: str, folder: Path) -> None:
    """Compare a record with its stored samples.

    Raises:
        ChangedRecordError: it differs, or none are stored.
    """
    stored = _stored().get(key)
    if stored is None:
        raise ChangedRecordError(f'{key}: no samples of it are stored in samples.json')
    for file, channels in samples_of(folder).items():
        for channel, values in channels.items():
            wanted = np.array(stored.get(file, {}).get(channel, []))
            scale = max(float(np.max(np.abs(wanted), initial=0.0)), 1e-3)
            if len(wanted) != len(values) or np.max(np.abs(values - wanted)) > _TOLERANCE * scale:
                raise ChangedRecordError(
                    f'{key}: {channel} of {file} is not what it was; the generator of the replay, '
                    'MuJoCo or NumPy changed, and its answers can not be compared'
                )


@cache
def _stored() -> dict[str, dict[str, dict[str, list[float]]]]:
    return json.loads((HERE / 'samples.json').read_text(encoding='utf-8'))


def samples_of(folder: Path) -> dict[str, dict[str, list[float]]]:
    """A few values of every channel, over the whole record, by file."""
    out = {}
    for path in sorted(folder.glob('*.npz')):
        with np.load(path) as data:
            out[path.stem] = {
                name: data[name].ravel()[_places(data[name].size)].tolist() for name in data.files
            }
    return out


def _places(size: int) -> Array:
    return np.linspace(0, size - 1, _CHECKED).astype(int)


def simulated(line: Mapping[str, Any], run: int, hidden: Hidden) -> Samples:
    """Samples with noise of one run of a line's machine."""
    m = machine(line['machine'], line['seed'])
    rng = np.random.default_rng([line['seed'], 201])
    share = line.get('bodies_off', 0.0 if m.free else _BODY)
    plant = m.plant(off(own_bodies(m), share, rng) if share else own_bodies(m), hidden)
    noise = np.random.default_rng([line['seed'], 202, run])
    if m.free:
        return flown(m, plant, line, noise)
    return stood(m, plant, line, run, noise)


def _reference(rng: np.random.Generator, q0: Array, motion: str, seconds: float) -> Any:
    """Angles, rates and accelerations (N, n) at times: harmonics of the record, from rest."""
    largest, first, last = MOTIONS[motion]
    k = np.arange(first, last + 1)
    w = 2.0 * math.pi / seconds
    a, b = rng.standard_normal((2, len(q0), len(k))) / k

    def at(t: Array) -> tuple[Array, Array, Array]:
        c, s = np.cos(np.outer(t, k * w)), np.sin(np.outer(t, k * w))
        q = (1.0 - c) @ a.T + (s - np.outer(t, k * w)) @ b.T
        qd = w * ((k * s) @ a.T + (k * (c - 1.0)) @ b.T)
        return q, qd, w * w * ((k * k * c) @ a.T - (k * k * s) @ b.T)

    b -= np.outer(b @ k, k) / (k @ k)  # back where it began
    scale = largest / np.max(np.abs(at(np.linspace(0.0, seconds, 400))[0]), axis=0)
    return lambda t: tuple(scale * x + (q0 if i == 0 else 0.0) for i, x in enumerate(at(t)))


def flown(
    m: Machine, plant: Plant, line: Mapping[str, Any], noise: np.random.Generator
) -> Samples:
    """A free flight: a controller that knows the true state follows the reference."""
    seconds = line.get('seconds', FLIGHT)
    motion = Motion(plant)
    model, data, n = motion.model, motion.data, len(m.joints)
    asked = _reference(np.random.default_rng([line['seed'], 203]), m.q0, line['motion'], seconds)
    count = round((seconds + 0.5) / STEP) + 1
    halves = asked(0.5 * STEP * np.arange(2 * count + 2))[:2]  # stages are on half steps
    data.qpos[motion.q] = m.q0
    data.qpos[3:7] = np.array([0.927, 0.2, 0.1, 0.3]) / np.linalg.norm([0.927, 0.2, 0.1, 0.3])
    data.qvel[3:6] = m.omega
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    inertia = 1.0 / np.diag(np.linalg.inv(full))[motion.v]

    def torque() -> Array:
        q, qd = (x[round(2.0 * data.time / STEP)] for x in halves)
        return inertia * (64.0 * (q - data.qpos[motion.q]) + 16.0 * (qd - data.qvel[motion.v]))

    motion.torque = torque
    rows = np.empty((count, 3 * n + 7))
    mujoco.set_mjcb_passive(motion.stage)
    try:
        for row in rows:
            mujoco.mj_forward(model, data)
            parts = (data.qpos[motion.q], data.qvel[motion.v], motion.applied)
            row[:] = np.concatenate([*parts, data.qvel[3:6], data.qpos[3:7]])
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    course = CubicSpline(STEP * np.arange(count), rows)
    t = np.arange(round(RATE * seconds) + 1) / RATE
    tracked = np.arange(round(TRACKER * seconds) + 1) / TRACKER

    def at(times: Array, clock: str, later: float = 0.0) -> Array:
        return course(np.maximum(times - plant.delays.get(clock, 0.0) - later, 0.0))

    joints, effort = at(t, 'joints'), at(t, 'joints', plant.delays.get('effort', 0.0))
    attitude = Rotation.from_quat(np.roll(at(tracked, 'attitude')[:, -4:], -1, axis=1))
    out = {'q': joints[:, :n], 'qd': joints[:, n : 2 * n], 'tau': effort[:, 2 * n : 3 * n]}
    out |= {'omega': at(t, 'imu')[:, 3 * n : 3 * n + 3], 'attitude': attitude.as_matrix()}
    for mend in plant.mends:
        mend(out)
    stds = (NOISE['position'], NOISE['velocity'], m.effort_std, NOISE['gyro'])
    for name, std in zip(('q', 'qd', 'tau', 'omega'), stds, strict=True):
        out[name] = out[name] + std * noise.standard_normal(out[name].shape)
    small = Rotation.from_rotvec(NOISE['attitude'] * noise.standard_normal((len(tracked), 3)))
    xyzw = (Rotation.from_matrix(out.pop('attitude')) * small).as_quat(canonical=True)
    return {'t': t, **out, 't_attitude': tracked, 'xyzw': xyzw}


def stood(
    m: Machine, plant: Plant, line: Mapping[str, Any], run: int, noise: np.random.Generator
) -> Samples:
    """An arm along a prescribed motion: MuJoCo's inverse dynamics, and what no cause is."""
    t = np.arange(round(RATE * line.get('seconds', ARM)) + 1) / RATE
    q, qd, qdd = _excited(np.random.default_rng([line['seed'], 204, run]), m, t)
    motion = Motion(plant)
    data, rigid = motion.data, np.empty_like(q)
    mujoco.set_mjcb_passive(motion.stage)
    try:
        for k, tau in enumerate(rigid):
            data.qpos[motion.q], data.qvel[motion.v], data.qacc[motion.v] = q[k], qd[k], qdd[k]
            mujoco.mj_inverse(motion.model, data)
            tau[:] = data.qfrc_inverse[motion.v]
    finally:
        mujoco.set_mjcb_passive(None)
    machine_rng = np.random.default_rng([line['seed'], 205])
    gains = 1.0 + _GAIN * machine_rng.standard_normal(len(m.joints))
    samples = {'q': q, 'tau': gains * (rigid + _gears(m, noise, q, qd)) / plant.gain}
    late = t - plant.delays.get('effort', 0.0)
    samples['tau'] = np.column_stack([np.interp(late, t, x) for x in samples['tau'].T])
    for mend in plant.mends:
        mend(samples)
    low = butter(2, _FILTER, fs=RATE, output='sos')
    effort = sosfiltfilt(low, samples['tau'], axis=0)
    effort = effort + _EFFORT * m.coulomb * noise.standard_normal(effort.shape)
    encoders = samples['q'] + NOISE['position'] * noise.standard_normal(q.shape)
    return {'t': t, 'q': encoders, 'tau': effort}


def _excited(rng: np.random.Generator, m: Machine, t: Array) -> tuple[Array, Array, Array]:
    w = 2.0 * math.pi * 0.1 * np.arange(1, 6)
    size, phase = rng.standard_normal((2, len(m.joints), 5))
    c, s = np.cos(t[:, None] * w), np.sin(t[:, None] * w)
    qd = c @ size.T + s @ phase.T
    scale = (1.0 + 0.12 * np.arange(len(m.joints))) / np.max(np.abs(qd), axis=0)
    q = (s / w) @ size.T - (c / w) @ phase.T
    return m.q0 + scale * q, scale * qd, scale * ((c * w) @ phase.T - (s * w) @ size.T)


def _gears(m: Machine, rng: np.random.Generator, q: Array, qd: Array) -> Array:
    """(N, n) friction that the file has, and what of it wanders [N m]."""
    direction, n = np.tanh(qd / _CREEP), len(m.joints)
    level = 1.0 + _BY_RUN * rng.standard_normal(n) + _DRIFT * _wandering(rng, q.shape, 20.0)
    torque = m.coulomb * level * direction + m.viscous * qd
    for memory, size in _WANDER.items():
        torque = torque + size * m.coulomb * _wandering(rng, q.shape, memory)
    phases = rng.uniform(0.0, 2.0 * math.pi, n)
    return torque + _RIPPLE * m.coulomb * np.sin(_TEETH * q + phases)


def _wandering(rng: np.random.Generator, shape: tuple[int, ...], memory: float) -> Array:
    """Ornstein-Uhlenbeck processes of unit variance and this memory [s]."""
    keep = math.exp(-1.0 / (RATE * memory))
    drive = rng.standard_normal(shape) * math.sqrt(1.0 - keep**2)
    drive[0] /= math.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))


def _map(m: Machine) -> str:
    lines = ['format: npz', 'time: {columns: t, unit: s}', 'joints:']
    lines.append(f'  names: [{", ".join(m.joints)}]')
    lines.append(f'  position: {{columns: q, unit: {_units(m, "rad", "m")}}}')
    if m.free:
        lines.append(f'  velocity: {{columns: qd, unit: {_units(m, "rad/s", "m/s")}}}')
    lines.append(f'  effort: {{columns: tau, unit: {_units(m, "N m", "N")}}}')
    if m.free:
        lines.append('gyro: {columns: omega, unit: rad/s}')
        lines.append('attitude:')
        lines.append('  {columns: xyzw, order: xyzw, time: {columns: t_attitude, unit: s}}')
    return '\n'.join(lines) + '\n'


def _units(m: Machine, turns: str, slides: str) -> str:
    kinds = [b.joint for b in own_bodies(m).values() if b.joint]
    by_name = {j['name']: slides if j['type'] == 'slide' else turns for j in kinds}
    return f'[{", ".join(by_name[j] for j in m.joints)}]'
