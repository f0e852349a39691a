"""Machines in MuJoCo, from the URDF that a robot file would have.

Nothing of the package is in here, and nothing may change: a record is checked by stored samples
(`records.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

STEP = 0.002  # s


@dataclass
class Body:
    """A body by what is linear in its mass: kg, (3,) kg m, (3, 3) second moments about its origin.

    `joint` is its own: name, hinge or slide, axis, further attributes of MuJoCo's joint.
    """

    parent: str
    pos: np.ndarray
    rpy: np.ndarray
    mass: float
    first: np.ndarray
    inertia: np.ndarray
    joint: dict[str, Any] = field(default_factory=dict)

    @property
    def com(self) -> np.ndarray:
        """(3,) centre of mass [m]."""
        return self.first / self.mass

    def add(self, mass: float, com: np.ndarray, central: np.ndarray, sign: float = 1.0) -> None:
        """A rigid part, by its centre and its inertia about that; -1 takes it out."""
        self.mass += sign * mass
        self.first = self.first + sign * mass * com
        self.inertia = self.inertia + sign * (central + mass * about(com))

    @property
    def inertial(self) -> str:
        """MuJoCo's element."""
        i = self.inertia - self.mass * about(self.com)
        full = text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
        return f'<inertial pos="{text(self.com)}" mass="{text(self.mass)}" fullinertia="{full}"/>'


def about(point: np.ndarray) -> np.ndarray:
    """(3, 3) inertia of a unit mass at a point."""
    return point @ point * np.eye(3) - np.outer(point, point)


def text(values: Any) -> str:
    """Numbers with all their digits."""
    return ' '.join(repr(float(v)) for v in np.ravel(values))


def bodies_of(urdf: str) -> dict[str, Body]:
    """Links with a mass of a URDF whose inertials and axes are not turned, parents first."""
    root = ET.fromstring(urdf)
    joints = {j.find('child').get('link'): j for j in root.findall('joint')}
    out: dict[str, Body] = {}

    def numbers(element: ET.Element | None, key: str) -> np.ndarray:
        found = None if element is None else element.get(key)
        return np.zeros(3) if found is None else np.array([float(x) for x in found.split()])

    for link in root.findall('link'):
        name, inertial = str(link.get('name')), link.find('inertial')
        origin = None if inertial is None else inertial.find('origin')
        v = {} if inertial is None else {**inertial.find('inertia').attrib}
        pairs = [['ixx', 'ixy', 'ixz'], ['ixy', 'iyy', 'iyz'], ['ixz', 'iyz', 'izz']]
        central = np.array([[float(v.get(k, 0.0)) for k in row] for row in pairs])
        mass = 0.0 if inertial is None else float(inertial.find('mass').get('value'))
        com, at = numbers(origin, 'xyz'), joints.get(name)
        place = None if at is None else at.find('origin')
        body = Body(
            '', numbers(place, 'xyz'), numbers(place, 'rpy'), 0.0, np.zeros(3), np.zeros((3, 3))
        )
        body.add(mass, com, central)
        if at is not None:
            body.parent = str(at.find('parent').get('link'))
            if at.get('type') != 'fixed':
                kind = 'slide' if at.get('type') == 'prismatic' else 'hinge'
                axis = numbers(at.find('axis'), 'xyz')
                body.joint = {'name': at.get('name'), 'type': kind, 'axis': axis}
        out[name] = body
    return out


@dataclass
class Plant:
    """A machine to be simulated; effects edit it.

    Args:
        bodies: By link.
        joints: Measured ones.
        base: Root link.
        free: Whether the base floats.
        gravity: (3,) [m/s^2].
        wheels: Momentum by link [N m s].
        drag: Time constant by link [s].
        gain: (n,) torque at the joint by the measured one.
        pushes: Called at every stage with `Motion`.
        mends: What sensors say, by channel, changed in place.
        delays: Of `joints`, `effort`, `imu`, `attitude` [s].
    """

    bodies: dict[str, Body]
    joints: tuple[str, ...]
    base: str
    free: bool
    gravity: np.ndarray
    wheels: dict[str, np.ndarray]
    gain: np.ndarray
    drag: dict[str, float] = field(default_factory=dict)
    pushes: list[Callable[[Motion], None]] = field(default_factory=list)
    mends: list[Callable[[dict[str, np.ndarray]], None]] = field(default_factory=list)
    delays: dict[str, float] = field(default_factory=dict)

    def joint(self, name: str) -> dict[str, Any]:
        """Attributes of a joint."""
        return next(b.joint for b in self.bodies.values() if b.joint.get('name') == name)

    def mjcf(self) -> str:
        """MuJoCo's model, without contacts."""

        def joint(own: dict[str, Any]) -> str:
            words = (f'{k}="{v if isinstance(v, str) else text(v)}"' for k, v in own.items())
            return f'<joint {" ".join(words)} solreffriction="{2 * STEP} 1"/>' if own else ''

        def body(name: str) -> str:
            b = self.bodies[name]
            moves = '<freejoint/>' if self.free and not b.parent else joint(b.joint)
            inner = ''.join(body(child) for child, c in self.bodies.items() if c.parent == name)
            return (
                f'<body name="{name}" pos="{text(b.pos)}" euler="{text(b.rpy)}">{moves}'
                f'{b.inertial if b.mass else ""}{inner}</body>'
            )

        return (
            '<mujoco><compiler angle="radian" eulerseq="XYZ" balanceinertia="false"/>'
            f'<option timestep="{STEP}" gravity="{text(self.gravity)}" integrator="RK4">'
            f'<flag contact="disable"/></option><worldbody>{body(self.base)}</worldbody></mujoco>'
        )


class Motion:
    """A plant that moves: MuJoCo's model and data, and where its joints are."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.model = mujoco.MjModel.from_xml_string(plant.mjcf())
        self.data = mujoco.MjData(self.model)
        ids = [self.model.joint(name).id for name in plant.joints]
        self.q, self.v = self.model.jnt_qposadr[ids], self.model.jnt_dofadr[ids]
        self.body = {name: self.model.body(name).id for name in plant.bodies}
        self.torque: Callable[[], np.ndarray] = lambda: np.zeros(len(ids))
        self.applied = np.zeros(len(ids))  # measured torques of the last stage

    def rotation(self, link: str) -> np.ndarray:
        """(3, 3) R_WL."""
        return self.data.xmat[self.body[link]].reshape(3, 3)

    def push(self, link: str, torque: Any, force: Any = (0.0, 0.0, 0.0), at: Any = None) -> None:
        """A torque and a force at a point, all in the inertial frame."""
        point = self.data.xpos[self.body[link]] if at is None else at
        mujoco.mj_applyFT(
            self.model,
            self.data,
            np.asarray(force, float),
            np.asarray(torque, float),
            point,
            self.body[link],
            self.data.qfrc_passive,
        )

    def stage(self, model: Any, data: Any) -> None:
        """What MuJoCo asks for at every stage."""
        self.applied = self.torque()
        data.qfrc_passive[self.v] += self.plant.gain * self.applied
        rate = np.zeros(6)
        for link, h in self.plant.wheels.items():
            mujoco.mj_objectVelocity(
                model, data, mujoco.mjtObj.mjOBJ_BODY, self.body[link], rate, 0
            )
            tau = self.plant.drag.get(link, math.inf)
            now = math.exp(-data.time / tau) * (self.rotation(link) @ h)
            self.push(link, now / tau - np.cross(rate[:3], now))
        for push in self.plant.pushes:
            push(self)
