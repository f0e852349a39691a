"""Machines of the replay: three that are described in `robots/`, drawn flyers, drawn arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .effects import EFFECTS, Hidden
from .plant import Body, Plant, bodies_of, text

NOISE = {'position': 2.0e-5, 'velocity': 2.0e-4, 'gyro': 2.0e-5, 'attitude': 3.0e-5}
Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Machine:
    """What its file says of a machine, and where a flight begins.

    Args:
        urdf: Text.
        joints: Measured ones.
        base: Root link.
        free: Whether it floats; else it stands under gravity.
        q0: (n,) [rad]. omega: (3,) rate of the base at the start [rad/s].
        wheels: Momentum of its own wheels [N m s].
        target: Link with the captured wheels. momentum: What the file believes of them [N m s].
        effort_std: Of a flight's torques [N m].
        coulomb, viscous: (n,) friction of an arm [N m], [N m s/rad], which its file has.
    """

    urdf: str
    joints: tuple[str, ...]
    base: str
    free: bool
    q0: Array
    omega: Sequence[float] = (0.0, 0.0, 0.0)
    wheels: Sequence[float] = (0.0, 0.0, 0.0)
    target: str = ''
    momentum: Sequence[float] = (0.0, 0.0, 0.0)
    effort_std: float = 0.05
    coulomb: Array | None = None
    viscous: Array | None = None

    def yaml(self) -> str:
        """The robot file."""
        lines = ['/**:', '  ros__parameters:', '    robot:', '      urdf: robot.urdf']
        lines += [
            f'      base: {"free" if self.free else "fixed"}',
            f'      base_link: {self.base}',
        ]
        lines.append(f'      gravity: [0.0, 0.0, {0.0 if self.free else -9.81}]')
        lines.append(f'      joints: [{", ".join(self.joints)}]')
        if not self.free:
            return '\n'.join([*lines, *self._friction()]) + '\n'
        lines.append(f'      servicer_wheels: {{momentum: {list(map(float, self.wheels))}}}')
        if self.target:
            believed = list(map(float, self.momentum))
            lines.append(f'      target_wheels: {{links: [{self.target}], momentum: {believed}}}')
        stds = {'joint_position': NOISE['position'], 'joint_velocity': NOISE['velocity']}
        stds |= {'joint_effort': self.effort_std}
        stds |= {'gyro': NOISE['gyro'], 'attitude': NOISE['attitude']}
        sensors = ', '.join(f'{name}_std: {std:.3e}' for name, std in stds.items())
        return '\n'.join([*lines, f'    sensors: {{{sensors}}}']) + '\n'

    def _friction(self) -> list[str]:
        if self.coulomb is None or self.viscous is None:
            return []
        out = ['    effects:']
        for joint, dry, wet in zip(self.joints, self.coulomb, self.viscous, strict=True):
            own = (
                f'dry_{joint}: {{effect: joint_coulomb_friction, where: {joint}, torque: {dry}}}',
                f'wet_{joint}: {{effect: joint_viscous_friction, where: {joint}, '
                f'coefficient: {wet}}}',
            )
            out += [f'      {line}' for line in own]
        return out

    def plant(self, bodies: dict[str, Body], hidden: Hidden) -> Plant:
        """The machine with these bodies, which its file may have otherwise, and what is hidden."""
        wheels = {self.base: np.array(self.wheels, float)} if self.free else {}
        if self.target:
            wheels[self.target] = np.array(self.momentum, float)
        gravity = np.array([0.0, 0.0, 0.0 if self.free else -9.81])
        gain = np.ones(len(self.joints))
        plant = Plant(bodies, self.joints, self.base, self.free, gravity, wheels, gain)
        for effect, where, values in hidden:
            EFFECTS[effect](plant, where, values)
        return plant


def machine(kind: str, seed: int) -> Machine:
    """`servicer`, `minisat` or `twin` of `robots/`; `flyer` or `arm`, drawn by the seed.

    A `client` is a flyer whose file believes the captured wheels at rest.
    """
    if kind == 'arm':
        return arm(seed)
    if kind in ('flyer', 'client'):
        drawn = flyer(seed)
        return replace(drawn, momentum=(0.0, 0.0, 0.0)) if kind == 'client' else drawn
    return _known(kind)


def _known(name: str) -> Machine:
    urdf = Path(__file__).with_name('robots').joinpath(f'{name}.urdf').read_text(encoding='utf-8')
    if name == 'servicer':
        joints, q0 = ('joint_1', 'joint_2', 'joint_3'), np.array([0.3, -0.5, 0.4])
        omega, wheels, momentum = (0.1, 0.12, 0.08), (25.0, 27.0, 28.0), (42.0, 49.0, 41.0)
        return Machine(
            urdf, joints, 'base_link', True, q0, omega, wheels, 'link_3', momentum, 0.05
        )
    if name == 'minisat':
        joints = ('joint_1', 'joint_2', 'joint_3', 'joint_4')
        return Machine(
            urdf, joints, 'base_link', True, np.array([1.57, 0.785, 0.785, 0.0]), effort_std=0.002
        )
    joints = tuple(f'{side}_joint_{k}' for side in ('left', 'right') for k in (1, 2, 3))
    q0, omega = np.array([0.3, 0.7, -0.4, -0.3, 0.8, 0.6]), (0.02, -0.03, 0.025)
    wheels, momentum = (4.0, -6.0, 5.0), (-7.0, 5.0, 11.0)
    return Machine(urdf, joints, 'base_link', True, q0, omega, wheels, 'left_3', momentum, 0.02)


def flyer(seed: int) -> Machine:
    """A chain of two to six joints with oblique axes, some of which slide; a client at its end."""
    rng = np.random.default_rng([seed, 101])
    n = 2 + seed % 5
    slide = int(rng.integers(n)) if seed % 4 == 3 else -1
    rows = [_drawn(rng, rng.uniform(100.0, 400.0), 1.2)]
    for k in range(n):
        last = k == n - 1
        rows.append(
            _drawn(
                rng,
                rng.uniform(30.0, 100.0) if last else rng.uniform(2.0, 15.0),
                0.25 + 0.5 * last,
            )
        )
    axes = rng.standard_normal((n, 3))
    places = rng.uniform(-0.4, 0.4, (n, 3))
    wheels, momentum = rng.uniform(-3.0, 3.0, (2, 3))
    q0 = rng.uniform(-0.5, 0.5, n) * np.where(np.arange(n) == slide, 0.2, 1.0)
    urdf = _urdf(rows, axes, places, slide)
    joints = tuple(f'j{k}' for k in range(1, n + 1))
    omega = rng.uniform(-0.02, 0.02, 3)
    return Machine(urdf, joints, 'b0', True, q0, omega, wheels, f'b{n}', 1.5 * momentum, 0.01)


def arm(seed: int) -> Machine:
    """An arm of four to six joints on the ground, with friction like a gear's."""
    rng = np.random.default_rng([seed, 102])
    n = 4 + seed % 3
    masses = rng.uniform(6.0, 9.0) * 0.65 ** np.arange(n) * rng.uniform(0.8, 1.2, n)
    rows: list[tuple[float, Array, Array]] = [(0.0, np.zeros(3), np.zeros((3, 3)))]
    axes, places, reach = np.zeros((n, 3)), np.zeros((n, 3)), 0.2
    for k, mass in enumerate(masses):
        length = rng.uniform(0.25, 0.4) * 0.8**k
        com = length * np.array([0.0, 0.1, 0.45]) * rng.uniform(0.5, 1.5, 3)
        slim = mass * length**2 / 12.0 * np.array([1.1, 1.0, 0.15])
        rows.append((mass, com, np.diag(slim)))
        axes[k] = ([0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1])[k]
        axes[k] += 0.15 * rng.standard_normal(3)
        places[k] = [0.02 if k else 0.0, 0.0, reach]
        reach = length
    weight = 9.81 * np.array([masses[k:].sum() * 0.3 * 0.8**k for k in range(n)])
    coulomb = np.round((0.15 * weight + 1.0) * rng.uniform(0.7, 1.3, n), 2)
    viscous = np.round(coulomb * rng.uniform(0.6, 1.4, n), 2)
    q0 = rng.uniform(-0.6, 0.6, n) + np.where(np.arange(n) == 1, 0.7, 0.0)
    joints = tuple(f'j{k}' for k in range(1, n + 1))
    urdf = _urdf(rows, axes, places, -1)
    return Machine(urdf, joints, 'b0', False, q0, coulomb=coulomb, viscous=viscous)


def _drawn(rng: np.random.Generator, mass: float, size: float) -> tuple[float, Array, Array]:
    extents = size * rng.uniform(0.2, 0.5, 3)
    axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    moments = mass * (axes * extents**2) @ axes.T
    com = 0.3 * size * rng.uniform(-1.0, 1.0, 3)
    return mass, com, np.trace(moments) * np.eye(3) - moments


def _urdf(rows: list[tuple[float, Array, Array]], axes: Array, places: Array, slide: int) -> str:
    parts = []
    for k, (mass, com, i) in enumerate(rows):
        values = {'ixx': i[0, 0], 'iyy': i[1, 1], 'izz': i[2, 2]}
        values |= {'ixy': i[0, 1], 'ixz': i[0, 2], 'iyz': i[1, 2]}
        moments = ' '.join(f'{name}="{value:.12g}"' for name, value in values.items())
        inertial = (
            f'<inertial><origin xyz="{_numbers(com)}"/><mass value="{mass:.12g}"/>'
            f'<inertia {moments}/></inertial>'
        )
        parts.append(f'<link name="b{k}">{inertial if mass else ""}</link>')
        if k:
            axis = axes[k - 1] / np.linalg.norm(axes[k - 1])
            kind = 'prismatic' if slide == k - 1 else 'revolute'
            parts.append(
                f'<joint name="j{k}" type="{kind}"><parent link="b{k - 1}"/><child link="b{k}"/>'
                f'<origin xyz="{_numbers(places[k - 1])}"/><axis xyz="{text(axis)}"/>'
                '<limit lower="-6.3" upper="6.3" effort="500" velocity="5"/></joint>'
            )
    return '\n'.join(['<robot name="drawn">', *parts, '</robot>'])


def _numbers(values: Array) -> str:
    return ' '.join(f'{x:.12g}' for x in values)


def off(bodies: dict[str, Body], share: float, rng: np.random.Generator) -> dict[str, Body]:
    """Bodies that the file has otherwise: factors of mass and of moments, and another centre.

    Args:
        bodies: Of the file.
        share: Standard deviation, of the centre by the radius of gyration.
        rng: Draws.
    """
    out = {}
    for name, b in bodies.items():
        z = share * rng.standard_normal(5)
        made = Body(b.parent, b.pos, b.rpy, 0.0, np.zeros(3), np.zeros((3, 3)), dict(b.joint))
        if b.mass:
            com = b.com
            central = b.inertia - b.mass * (com @ com * np.eye(3) - np.outer(com, com))
            radius = np.sqrt(0.5 * np.trace(central) / b.mass)
            made.add(b.mass * np.exp(z[0]), com + radius * z[1:4], central * np.exp(z[0] + z[4]))
        out[name] = made
    return out


def own_bodies(m: Machine) -> dict[str, Body]:
    """As the file has them."""
    return bodies_of(m.urdf)
