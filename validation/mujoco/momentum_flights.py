r"""Wheel momentum of robots that nobody designed, against MuJoCo's truth.

    python -m validation momentum-flights --flights 60 \
        --out validation/records/momentum_flights.jsonl

Drawn chains of two to seven joints with oblique axes, one of which slides in every sixth, on a
free base; the last link carries a client with wheels that the robot file believes at rest. MuJoCo
moves them for 40 s along band-limited references; nothing acts from outside. The robot file is
right, or every body's mass, centre (in radii of gyration) and factor of second moments were drawn
about it with a standard deviation of 0.1 or 0.3. Seeded; what stands in the output is not done
again. The table: valid, errors of the wheel momentum, and z, the error of an axis by its stated
deviation.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

SECONDS, STEP, RATE = 40.0, 0.002, 100.0
OFF = (0.0, 0.1, 0.3)
NOISE = {'position': 2.0e-5, 'velocity': 2.0e-4, 'gyro': 2.0e-5, 'attitude': 3.0e-5}


@dataclass
class Body:
    """A body: mass, centre (3,), factor (3, 3) of second moments; and its joint, if any."""

    mass: float
    com: np.ndarray
    factor: np.ndarray
    at: np.ndarray
    axis: np.ndarray
    slides: bool = False

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3) about the centre of mass."""
        moments = self.factor @ self.factor.T
        return np.trace(moments) * np.eye(3) - moments

    def drawn(self, off: float, rng: np.random.Generator) -> Body:
        """Another body, `off` standard deviations of which are one of the file's."""
        z = off * rng.standard_normal(10)
        spread = np.sqrt(np.sum(self.factor**2) / 3.0)
        gyration = np.sqrt(np.sum(self.factor**2) / self.mass)
        factor = self.factor.copy()
        factor[np.arange(3), np.arange(3)] *= np.exp(z[4:7])
        factor[[1, 2, 2], [0, 0, 1]] += spread * z[7:]
        com = self.com + gyration * z[1:4]
        return Body(self.mass * np.exp(z[0]), com, factor, self.at, self.axis, self.slides)


def draw(seed: int) -> tuple[list[Body], dict[str, np.ndarray], np.random.Generator]:
    """A robot file's bodies and momenta, and where the random numbers go on."""
    rng = np.random.default_rng((seed, 4711))
    joints = 2 + seed % 6
    slide = int(rng.integers(joints)) if (seed // 6 + seed) % 6 == 5 else -1
    bodies = [_body(rng, rng.uniform(100.0, 400.0), 1.2, np.zeros(3), np.zeros(3), False)]
    for k in range(joints):
        axis = rng.standard_normal(3)
        at = (
            np.array([0.5, 0.3, 0.2]) * rng.uniform(-1, 1, 3)
            if k == 0
            else rng.uniform(-0.4, 0.4, 3)
        )
        mass = rng.uniform(40.0, 120.0) if k == joints - 1 else rng.uniform(2.0, 15.0)
        size = 0.8 if k == joints - 1 else 0.25
        bodies.append(_body(rng, mass, size, at, axis / np.linalg.norm(axis), k == slide))
    direction = rng.standard_normal(3)
    momenta = {
        'target': rng.uniform(0.5, 5.0) * direction / np.linalg.norm(direction),
        'servicer': rng.uniform(-3.0, 3.0, 3),
    }
    return bodies, momenta, rng


def _body(rng, mass, size, at, axis, slides) -> Body:  # type: ignore[no-untyped-def]
    extents = size * rng.uniform(0.2, 0.5, 3)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    moments = mass * (turn * extents**2) @ turn.T
    return Body(
        mass, 0.3 * size * rng.uniform(-1, 1, 3), np.linalg.cholesky(moments), at, axis, slides
    )


def _numbers(values: Any) -> str:
    return ' '.join(f'{x:.12g}' for x in np.ravel(values))


def mjcf(bodies: list[Body]) -> str:
    """The robot in MuJoCo."""

    def inertial(b: Body) -> str:
        i = b.inertia
        full = _numbers([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
        return f'<inertial pos="{_numbers(b.com)}" mass="{b.mass:.12g}" fullinertia="{full}"/>'

    text = f'<body name="b0"><freejoint/>{inertial(bodies[0])}'
    for k, b in enumerate(bodies[1:], 1):
        kind = 'slide' if b.slides else 'hinge'
        text += f'<body name="b{k}" pos="{_numbers(b.at)}">{inertial(b)}'
        text += f'<joint name="j{k}" type="{kind}" axis="{_numbers(b.axis)}"/>'
    text += '</body>' * len(bodies)
    options = f'<option timestep="{STEP}" integrator="RK4" gravity="0 0 0"/>'
    return f'<mujoco><compiler angle="radian"/>{options}<worldbody>{text}</worldbody></mujoco>'


def urdf(bodies: list[Body]) -> str:
    """The robot file's URDF."""
    parts = []
    for k, b in enumerate(bodies):
        i = b.inertia
        values = {'ixx': i[0, 0], 'iyy': i[1, 1], 'izz': i[2, 2]}
        values |= {'ixy': i[0, 1], 'ixz': i[0, 2], 'iyz': i[1, 2]}
        moments = ' '.join(f'{name}="{value:.12g}"' for name, value in values.items())
        parts.append(
            f'<link name="b{k}"><inertial><origin xyz="{_numbers(b.com)}"/>'
            f'<mass value="{b.mass:.12g}"/><inertia {moments}/></inertial></link>'
        )
        if k:
            kind = 'prismatic' if b.slides else 'revolute'
            parts.append(
                f'<joint name="j{k}" type="{kind}"><parent link="b{k - 1}"/><child link="b{k}"/>'
                f'<origin xyz="{_numbers(b.at)}"/><axis xyz="{_numbers(b.axis)}"/>'
                '<limit lower="-6" upper="6" effort="500" velocity="5"/></joint>'
            )
    return f'<robot name="drawn">{"".join(parts)}</robot>'


def fly(
    bodies: list[Body],
    momenta: dict[str, np.ndarray],
    rng: np.random.Generator,
    attitude_rate: float,
):  # type: ignore[no-untyped-def]
    """Clean samples: time, q, qd, omega at 100 Hz, and attitude xyzw at its rate."""
    model = mujoco.MjModel.from_xml_string(mjcf(bodies))
    data, n = mujoco.MjData(model), len(bodies) - 1
    data.qpos[7:] = q0 = rng.uniform(-0.5, 0.5, n) * np.array(
        [0.2 if b.slides else 1.0 for b in bodies[1:]]
    )
    data.qvel[3:6] = rng.uniform(-0.02, 0.02, 3)
    size = np.array([0.08 if b.slides else 0.5 for b in bodies[1:]])
    rates = 2.0 * np.pi * rng.uniform(0.02, 0.15, (n, 5))
    a = rng.standard_normal((n, 5)) * size[:, None] / np.sqrt(5.0)
    wheels = ((1 + n, momenta['target']), (1, momenta['servicer']))
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    inertia = 1.0 / np.diag(np.linalg.inv(full))[6:]
    jacobian = np.zeros((3, model.nv))

    def push(m: Any, d: Any) -> None:
        t = d.time
        ramp = min(t / 4.0, 1.0) ** 2 * (3.0 - 2.0 * min(t / 4.0, 1.0))
        wave, slope = np.sin(rates * t), rates * np.cos(rates * t)
        q, qd = q0 + ramp * np.sum(a * wave, axis=1), ramp * np.sum(a * slope, axis=1)
        d.qfrc_passive[6:] += inertia * (16.0 * (q - d.qpos[7:]) + 8.0 * (qd - d.qvel[6:]))
        for body, h in wheels:
            mujoco.mj_jacBody(m, d, None, jacobian, body)
            omega = jacobian @ d.qvel
            torque = -np.cross(omega, d.xmat[body].reshape(3, 3) @ h)
            d.qfrc_passive[:] += jacobian.T @ torque

    samples = round(SECONDS * RATE) + 1
    every = round(1.0 / (RATE * STEP))
    out = [np.zeros((samples, width)) for width in (n, n, 3, 4)]
    mujoco.set_mjcb_passive(push)
    try:
        for k in range(samples):
            parts = (data.qpos[7:], data.qvel[6:], data.qvel[3:6], data.qpos[[4, 5, 6, 3]])
            for array, part in zip(out, parts, strict=True):
                array[k] = part
            for _ in range(every):
                mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    time_s = np.arange(samples) / RATE
    tracked = slice(None, None, round(RATE / attitude_rate))
    return time_s, *out[:3], time_s[tracked], out[3][tracked]


def noisy(flight: Any, rng: np.random.Generator) -> Any:
    """The same with the sensors' noise."""
    time_s, q, qd, omega, tracked, xyzw = flight
    q = q + NOISE['position'] * rng.standard_normal(q.shape)
    qd = qd + NOISE['velocity'] * rng.standard_normal(qd.shape)
    omega = omega + NOISE['gyro'] * rng.standard_normal(omega.shape)
    small = 0.5 * NOISE['attitude'] * rng.standard_normal((len(xyzw), 3))
    v, w = xyzw[:, :3], xyzw[:, 3:]
    turned = np.concatenate(
        [v + w * small + np.cross(v, small), w - np.sum(v * small, 1)[:, None]], 1
    )
    return time_s, q, qd, omega, tracked, turned / np.linalg.norm(turned, axis=1)[:, None]


def identified(seed: int, off: float, method: str = 'ml') -> dict[str, Any]:
    """One flight, flown and identified."""
    from spacerobot_ros.effects.robot_file import load_robot_file
    from spacerobot_ros.identification.batch import identify
    from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

    bodies, momenta, rng = draw(seed)
    truth = [b.drawn(off, rng) for b in bodies] if off else bodies
    attitude_rate = 10.0 if seed % 2 else 2.0
    time_s, q, qd, omega, tracked, xyzw = noisy(fly(truth, momenta, rng, attitude_rate), rng)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, 'drawn.urdf').write_text(urdf(bodies), encoding='utf-8')
        joints = ', '.join(f'j{k}' for k in range(1, len(bodies)))
        stds = {'joint_position': 'position', 'joint_velocity': 'velocity'}
        stds |= {'gyro': 'gyro', 'attitude': 'attitude'}
        sensors = ', '.join(f'{name}_std: {NOISE[key]:.1e}' for name, key in stds.items())
        wheels = ', '.join(f'{h:.9g}' for h in momenta['servicer'])
        Path(folder, 'drawn.yaml').write_text(
            '/**:\n  ros__parameters:\n    robot:\n      urdf: drawn.urdf\n'
            f'      joints: [{joints}]\n      servicer_wheels: {{momentum: [{wheels}]}}\n'
            f'      target_wheels: {{links: [b{len(bodies) - 1}], momentum: [0.0, 0.0, 0.0]}}\n'
            f'    sensors: {{{sensors}}}\n',
            encoding='utf-8',
        )
        file = load_robot_file(Path(folder, 'drawn.yaml'))
    stamps = np.round(time_s * 1e9).astype(np.int64)
    record = Record(
        joints=JointSeries(file.robot.joints, stamps, q, qd, None),
        rates=RateSeries(stamps, omega),
        attitudes=AttitudeSeries(np.round(tracked * 1e9).astype(np.int64), xyzw),
    )
    begun = time.process_time()
    estimate = identify(record, file.robot, file.settings.identifier, method).estimate
    h, error = momenta['target'], estimate.aam - momenta['target']
    return {
        'seed': seed,
        'off': off,
        'joints': len(bodies) - 1,
        'slides': any(b.slides for b in bodies),
        'valid': estimate.valid,
        'reason': estimate.reason,
        'error_percent': 100.0 * float(np.linalg.norm(error) / np.linalg.norm(h)),
        'z': (error / estimate.std[:3]).tolist(),
        'std_percent': 100.0 * float(np.max(estimate.std[:3]) / np.linalg.norm(h)),
        'chi2': estimate.chi2_per_dof,
        'factor': estimate.prior_factor,
        'rank': estimate.rank,
        'unknowns': estimate.unknowns,
        'cpu_s': time.process_time() - begun,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """What the flights come to."""
    lines = ['| file off by | flights | valid | error < 1 % | median error, % | z rms | worst z |']
    lines.append('|---|---|---|---|---|---|---|')
    for off in (*OFF, None):
        own = [r for r in rows if off is None or r['off'] == off]
        if not own:
            continue
        z = np.array([r['z'] for r in own])
        errors = np.array([r['error_percent'] for r in own])
        cells = (
            'all' if off is None else f'{off:g}',
            len(own),
            sum(r['valid'] for r in own),
            int(np.sum(errors < 1.0)),
            f'{np.median(errors):.3f}',
            f'{np.sqrt(np.mean(z**2)):.2f}',
            f'{np.max(np.abs(z)):.2f}',
        )
        lines.append('| ' + ' | '.join(map(str, cells)) + ' |')
    return '\n'.join(lines)


def main() -> None:
    """Fly what is missing, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument('--flights', type=int, default=60)
    parser.add_argument('--first', type=int, default=0, help='first seed')
    parser.add_argument('--out', type=Path, required=True)
    parser.add_argument('--processes', type=int, default=2)
    args = parser.parse_args()
    rows = []
    if args.out.exists():
        rows = [json.loads(line) for line in args.out.read_text(encoding='utf-8').splitlines()]
    done = {(r['seed'], r['off']) for r in rows}
    wanted = [(args.first + k, OFF[k % 3]) for k in range(args.flights)]
    left = [each for each in wanted if each not in done]
    with ProcessPoolExecutor(args.processes) as pool:
        for row in pool.map(identified, *zip(*left, strict=True)) if left else ():
            rows.append(row)
            with args.out.open('a', encoding='utf-8') as out:
                out.write(json.dumps(row) + '\n')
            print(f'{len(rows)}: {row}', flush=True)
    print(table([r for r in rows if (r['seed'], r['off']) in set(wanted)]))


if __name__ == '__main__':
    main()
