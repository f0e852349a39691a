"""Any URDF as an editable list of bodies, and that list as a MuJoCo model.

Own parser, own numbers: nothing here comes from the product, so that a truth built on it is
independent. Bodies may be changed before the model is built (payload, take-outs) and get company:
a sprung disc (flexible appendage), a sprung point mass (slosh), a motor rotor before a joint.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

import numpy as np

TINY = 1e-9  # kg, kg m^2: of bodies that only carry a joint


@dataclass
class Inertial:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2], both in the link's frame."""

    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def add(self, other: Inertial, sign: float = 1.0) -> None:
        """Another body rigidly attached (or taken out with sign -1), by the parallel axes."""
        mass = self.mass + sign * other.mass
        com = (self.mass * self.com + sign * other.mass * other.com) / mass if mass else self.com
        about = self._about(com) + sign * other._about(com)
        self.mass, self.com, self.inertia = mass, com, about
        moments = np.linalg.eigvalsh(about)
        if mass < 0.0 or moments[0] < 0.0 or moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
            raise ValueError('what is taken out does not fit into the body')

    def _about(self, point: np.ndarray) -> np.ndarray:
        d = self.com - point
        return self.inertia + self.mass * (d @ d * np.eye(3) - np.outer(d, d))


@dataclass
class Hinge:
    """A joint of one degree of freedom."""

    name: str
    kind: str  # hinge | slide
    axis: np.ndarray
    armature: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass
class Link:
    """A body with the joints between it and its parent (none: welded)."""

    name: str
    parent: str
    pos: np.ndarray
    rpy: np.ndarray
    inertial: Inertial
    hinges: list[Hinge] = field(default_factory=list)


def vector(text: str | None) -> np.ndarray:
    """Three numbers, zero where absent."""
    return np.zeros(3) if text is None else np.array([float(v) for v in text.split()])


def rotation(rpy: np.ndarray) -> np.ndarray:
    """Rotation matrix of fixed-axis roll, pitch, yaw."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def parse(urdf: str) -> dict[str, Link]:
    """Links by name, parents first."""
    root = ET.fromstring(urdf)
    joints = {j.find('child').get('link'): j for j in root.findall('joint')}
    elements = {e.get('name'): e for e in root.findall('link')}
    links: dict[str, Link] = {}

    def add(name: str) -> None:
        joint = joints.get(name)
        link = Link(name, '', np.zeros(3), np.zeros(3), _inertial(elements[name]))
        if joint is not None:
            link.parent = joint.find('parent').get('link')
            if link.parent not in links:
                add(link.parent)
            origin = joint.find('origin')
            if origin is not None:
                link.pos, link.rpy = vector(origin.get('xyz')), vector(origin.get('rpy'))
            if joint.get('type') != 'fixed':
                axis = joint.find('axis')
                axis = np.array([1.0, 0.0, 0.0]) if axis is None else vector(axis.get('xyz'))
                kind = 'slide' if joint.get('type') == 'prismatic' else 'hinge'
                link.hinges.append(Hinge(joint.get('name'), kind, axis / np.linalg.norm(axis)))
        links[name] = link

    for name in elements:
        if name not in links:
            add(name)
    return links


def _inertial(element: ET.Element) -> Inertial:
    inertial = element.find('inertial')
    if inertial is None:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    origin = inertial.find('origin')
    com, rpy = (vector(None if origin is None else origin.get(k)) for k in ('xyz', 'rpy'))
    v = {k: float(x) for k, x in inertial.find('inertia').attrib.items()}
    tensor = np.array(
        [
            [v['ixx'], v['ixy'], v['ixz']],
            [v['ixy'], v['iyy'], v['iyz']],
            [v['ixz'], v['iyz'], v['izz']],
        ]
    )
    R = rotation(rpy)
    return Inertial(float(inertial.find('mass').get('value')), com, R @ tensor @ R.T)


def to_mjcf(
    links: dict[str, Link], *, free: bool, gravity: np.ndarray, dt: float, integrator: str = 'RK4'
) -> str:
    """MuJoCo model without contacts; the base is free or fixed to the world."""

    def joint(h: Hinge) -> str:
        return (
            f'<joint name="{h.name}" type="{h.kind}" axis="{text(h.axis)}" '
            f'armature="{h.armature!r}" stiffness="{h.stiffness!r}" damping="{h.damping!r}"/>'
        )

    def body(link: Link) -> str:
        i = link.inertial
        inertial = ''
        if i.mass > 0.0:
            t = i.inertia
            full = text([t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]])
            inertial = (
                f'<inertial pos="{text(i.com)}" mass="{float(i.mass)!r}" fullinertia="{full}"/>'
            )
        joints = ''.join(joint(h) for h in link.hinges)
        if free and not link.parent:
            joints = '<freejoint/>'
        children = ''.join(body(c) for c in links.values() if c.parent == link.name)
        return (
            f'<body name="{link.name}" pos="{text(link.pos)}" euler="{text(link.rpy)}">'
            f'{joints}{inertial}{children}</body>'
        )

    base = next(link for link in links.values() if not link.parent)
    return (
        '<mujoco><compiler angle="radian" eulerseq="XYZ"/>'
        f'<option timestep="{dt!r}" gravity="{text(gravity)}" integrator="{integrator}">'
        '<flag contact="disable" constraint="disable" autoreset="disable"/></option>'
        f'<worldbody>{body(base)}</worldbody></mujoco>'
    )


def add_disc(
    links: dict[str, Link],
    host: str,
    inertia: float,
    axis: np.ndarray,
    frequency: float,
    damping: float,
    boom: tuple[float, np.ndarray, np.ndarray] | None = None,
) -> str:
    """A disc on a sprung hinge at the host's centre of mass, or a boom, taken out of the host.

    Held by an infinitely stiff spring it is the host's own inertia again.

    Args:
        links: All links.
        host: Link that carries it.
        inertia: About the hinge [kg m^2].
        axis: (3,) of the hinge.
        frequency: sqrt(stiffness / inertia) [rad/s].
        damping: Ratio.
        boom: Mass [kg], place of the hinge in the host's frame, and of the mass from there [m].
    """
    axis = axis / np.linalg.norm(axis)
    tensor = inertia * (np.outer(axis, axis) + 0.6 * (np.eye(3) - np.outer(axis, axis)))
    mass, com, lever = 1e-3 * links[host].inertial.mass, links[host].inertial.com, np.zeros(3)
    if boom is not None:
        mass, com, lever = boom
        tensor = tensor * (1.0 - mass * np.sum(np.cross(axis, lever) ** 2) / inertia)
    com = com.copy()
    links[host].inertial.add(Inertial(mass, com + lever, tensor), -1.0)
    hinge = Hinge(
        f'{host}_appendage',
        'hinge',
        axis,
        stiffness=inertia * frequency**2,
        damping=2.0 * damping * inertia * frequency,
    )
    name = f'{host}_disc'
    moved = Inertial(mass, lever, tensor)
    links[name] = Link(name, host, com, np.zeros(3), moved, [hinge])
    return hinge.name


def add_slosh(
    links: dict[str, Link], host: str, mass: float, frequency: float, damping: float
) -> None:
    """A point mass on springs at the host's centre of mass, taken out of the host."""
    com = links[host].inertial.com.copy()
    links[host].inertial.add(Inertial(mass, com, np.zeros((3, 3))), -1.0)
    parent, pos = host, com
    for k, axis in enumerate(np.eye(3)):
        name = f'{host}_fuel_{"xyz"[k]}'
        hinge = Hinge(
            name, 'slide', axis, 0.0, mass * frequency**2, 2 * damping * mass * frequency
        )
        own = Inertial(mass if k == 2 else TINY, np.zeros(3), TINY * np.eye(3))
        links[name] = Link(name, parent, pos, np.zeros(3), own, [hinge])
        parent, pos = name, np.zeros(3)


def add_motor(
    links: dict[str, Link], joint: str, rotor: float, stiffness: float, damping: float
) -> str:
    """A motor before a joint: motor hinge, spring, link. Returns the motor hinge's name.

    The rotor's inertia is reflected, as an armature: it knows the motor's own rate alone. The
    joint's own name stays with the spring; link angle = motor angle + spring angle.
    """
    link = next(x for x in links.values() if any(h.name == joint for h in x.hinges))
    spring = link.hinges[0]
    motor = Hinge(f'{joint}_motor', spring.kind, spring.axis, rotor)
    spring.armature, spring.stiffness, spring.damping = 0.0, stiffness, damping
    link.hinges = [motor, spring]  # both about the same axis: two joints of one body
    return motor.name


def text(values: np.ndarray | list[float]) -> str:
    """Numbers in full precision."""
    return ' '.join(repr(float(v)) for v in values)
