"""The extended model for MuJoCo (MJCF).

Bodies, joints, limits, motors and sensors of the robot that the effects make. A gyrostat becomes
a small ball that spins about its momentum: its inertia is taken out of the host, and is so small
that the momentum relative to the host stays what it is. Start it from the keyframe `start`, which
holds the wheels' rates.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...effects.effect import Effect
from ...effects.motion import Motion
from ...effects.robot_file import RobotFile
from ...errors import ConfigurationError
from ...model.body import Body, Gyrostat, inertia_ellipsoid, tree_order
from ...model.robot import Robot
from ...types import Array
from .losses import (
    Exported,
    in_words,
    only_changes_robot,
    sensor_limits,
    with_rigid_bodies,
    without,
)

_STEP = 1e-3  # s, at most
_SMALL = 1e-6
"""Of the host's smallest moment: what a ball's axis adds to its momentum as the host turns."""
_JOINT: Mapping[str, tuple[tuple[str, str], ...]] = {
    'joint_viscous_friction': (('damping', 'coefficient'),),
    'joint_coulomb_friction': (('frictionloss', 'torque'),),
    'joint_stiffness': (('stiffness', 'stiffness'), ('springref', 'rest_angle')),
}
"""Attributes of `<joint>` and the parameters that they are, by effect."""
_LEAST, _MINIMUM = 1e-9, 1e-14
"""Of the smallest mass and moment, what a moving body without any is given: more than MuJoCo's
least (1e-15), and less than the ninth digit of the mass matrix."""
_DELAYS = {'joints': 'joint', 'effort': 'effort', 'imu': 'gyro', 'attitude': 'attitude'}
"""Sensors by the clock that is late."""
_GAINS = ('joint_torque_constant', 'motor_constant')


@dataclass(slots=True)
class _Written:
    """What effects add to the file: attributes of joints, gains of motors, delays of sensors."""

    robot: Robot
    joints: dict[str, dict[str, float]] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)

    def add(self, effect: Effect) -> bool:
        """Write an effect; whether that could be done."""
        if effect.id in _JOINT:
            own = self.joints.setdefault(str(effect.where), {})
            names = [attribute for attribute, _ in _JOINT[effect.id]]
            if len(names) > 1 and names[0] in own:
                return False  # two springs of one joint
            for attribute, parameter in _JOINT[effect.id]:
                own[attribute] = own.get(attribute, 0.0) + effect[parameter]
            return True
        if effect.id in _GAINS:
            where = str(effect.where)
            self.gains[where] = self.gains.get(where, 1.0) * _gain(effect, self.robot)
            return True
        late = {clock: effect.delay(clock) for clock in _DELAYS if effect.acts('delay')}
        if late and all(delay >= 0.0 for delay in late.values()):
            for clock, delay in late.items():
                sensor = _DELAYS[clock]
                self.delays[sensor] = self.delays.get(sensor, 0.0) + delay
            return True
        return only_changes_robot(effect) and effect.id != 'command_delay'


def _gain(effect: Effect, robot: Robot) -> float:
    """Torque at a joint of a unit of its motor's, all at rest."""
    still, one = np.zeros((1, robot.n_joints)), np.ones((1, robot.n_joints))
    motion = Motion(robot, np.zeros(1), still, still, one)
    return 1.0 + float(effect.force(motion, np.zeros((1, 0))).sum())


def to_mjcf(file: RobotFile) -> Exported:
    """Write the robot that a robot file's effects make, as far as MuJoCo goes."""
    believed, changed = with_rigid_bodies(file.believed)
    _refuse_wheels_on_nothing(believed)
    believed, given = _with_least(believed)
    robot = believed.with_free_rotors(np.array([rotor.rate for rotor in believed.rotors]))
    written = _Written(robot)
    included = [effect for effect in file.effects if written.add(effect)]
    step = file.settings.simulator.period / math.ceil(file.settings.simulator.period / _STEP)
    root = ElementTree.Element('mujoco', model=robot.name)
    ElementTree.SubElement(root, 'compiler', angle='radian')
    option = ElementTree.SubElement(
        root, 'option', timestep=repr(step), gravity=_text(robot.gravity), integrator='RK4'
    )
    ElementTree.SubElement(option, 'flag', contact='disable')
    world = ElementTree.SubElement(root, 'worldbody')
    balls = [_ball(robot, gyrostat) for gyrostat in robot.gyrostats if gyrostat.momentum.any()]
    for ball in balls:
        robot = robot.with_body(ball.host, robot.bodies[ball.host].without(ball.body))
    _add_bodies(world, robot, balls, written)
    _add_motors(root, robot, written)
    _add_sensors(root, robot, written, step)
    _add_start(root, robot, balls, file)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding='unicode') + '\n'
    lost = (
        *changed,
        *given,
        *_single_places(believed),
        *sensor_limits(believed, '_std'),
        *without(file.effects, included),
    )
    return Exported(text, tuple(map(in_words, included)), lost)


def _refuse_wheels_on_nothing(robot: Robot) -> None:
    """Raise ConfigurationError where wheels have a link that has no inertia of its own."""
    for gyrostat in robot.gyrostats:
        if gyrostat.momentum.any() and not robot.bodies[gyrostat.body].inertia.any():
            why = 'has wheels and no inertia: MuJoCo can not hold them, give it some'
            raise ConfigurationError(f'link {gyrostat.link!r}', why)


def _with_least(robot: Robot) -> tuple[Robot, list[str]]:
    """The robot with mass and inertia wherever something moves, and what had to be given."""
    given = []
    masses = [body.mass for body in robot.bodies if body.mass > 0.0]
    moments = [np.linalg.eigvalsh(body.inertia) for body in robot.bodies]
    least_mass = max(_LEAST * min(masses), _MINIMUM)
    least = max(
        _LEAST * min(float(m[m > 0.0].min()) for m in moments if (m > 0.0).any()), _MINIMUM
    )
    for k in range(0 if robot.is_free else 1, len(robot.bodies)):
        body = robot.bodies[k]
        own, axes = np.linalg.eigh(body.inertia)
        if body.mass >= least_mass and own[0] >= least:
            continue
        what = 'mass' if body.mass < least_mass else 'inertia about every axis'
        enough = (axes * np.maximum(own, least)) @ axes.T
        mass = max(body.mass, least_mass)
        robot = robot.with_body(k, replace(body, mass=mass, inertia=enough))
        given.append(
            f'that {body.name} has no {what}: MuJoCo needs some, and has at least '
            f'{least_mass:.3g} kg and {least:.3g} kg m^2'
        )
    return robot, given


def _single_places(robot: Robot) -> Iterator[str]:
    """Limits that are one place, which MuJoCo takes for no range."""
    for joint, (low, high) in zip(robot.joints, robot.position_limits.tolist(), strict=True):
        if low == high:
            yield f'limits of {joint}, both of them {low:g}'


@dataclass(frozen=True, slots=True, eq=False)
class _Ball:
    """A gyrostat as a body that spins.

    Args:
        host: Index of its body. body: It, in the host's frame. rate: Of its spin [rad/s].
    """

    host: int
    body: Body
    rate: float


def _ball(robot: Robot, gyrostat: Gyrostat) -> _Ball:
    host, momentum = robot.bodies[gyrostat.body], gyrostat.body_momentum
    size = float(np.linalg.norm(momentum))
    inertia = _SMALL * float(np.linalg.eigvalsh(host.inertia)[0])
    body = Body(
        name=_free(f'{gyrostat.link}_wheels', [*(b.name for b in robot.bodies), *robot.joints]),
        parent=gyrostat.body,
        rotation=np.eye(3),
        translation=host.com,
        axis=momentum / size,
        is_prismatic=False,
        mass=_SMALL * host.mass,
        inertia=inertia * np.eye(3),
    )
    return _Ball(gyrostat.body, body, size / inertia)


def _add_bodies(
    world: ElementTree.Element, robot: Robot, balls: Sequence[_Ball], written: _Written
) -> None:
    places: dict[int, ElementTree.Element] = {}
    for i in (0, *tree_order(robot.bodies)):
        body = robot.bodies[i]
        parent = world if body.parent < 0 else places[body.parent]
        place = _add_body(parent, body)
        _add_ellipsoid(place, body)
        if i == 0 and robot.is_free:
            place.insert(0, ElementTree.Element('freejoint', name=_free('base', robot.joints)))
        elif i > 0:
            name = robot.joints[i - 1]
            place.insert(0, _joint(name, body, robot.position_limits[i - 1], written))
        if i == 0:
            ElementTree.SubElement(place, 'site', name='base')
            for thruster in robot.thrusters:
                name = _free(thruster.name, ['base'])
                ElementTree.SubElement(place, 'site', name=name, pos=_text(thruster.at))
        for ball in balls:
            if ball.host == i:
                spinning = _add_body(place, ball.body)
                axis = _text(ball.body.axis)
                spinning.insert(
                    0, ElementTree.Element('joint', name=ball.body.name, type='hinge', axis=axis)
                )
        places[i] = place


def _add_body(parent: ElementTree.Element, body: Body) -> ElementTree.Element:
    quat = np.roll(Rotation.from_matrix(body.rotation).as_quat(), 1)
    place = ElementTree.SubElement(
        parent,
        'body',
        name=_free(body.name, ['world']),
        pos=_text(body.translation),
        quat=_text(quat),
    )
    if body.mass > 0.0:
        full = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        ElementTree.SubElement(
            place, 'inertial', pos=_text(body.com), mass=repr(body.mass), fullinertia=_text(full)
        )
    return place


def _add_ellipsoid(place: ElementTree.Element, body: Body) -> None:
    """To be seen; it weighs and touches nothing."""
    seen = inertia_ellipsoid(body)
    if seen is not None:
        half_axes, axes = seen
        quat = np.roll(Rotation.from_matrix(axes).as_quat(), 1)
        shape = {'type': 'ellipsoid', 'size': _text(half_axes), 'mass': '0'}
        where = {'pos': _text(body.com), 'quat': _text(quat)}
        through = {'contype': '0', 'conaffinity': '0'}
        ElementTree.SubElement(place, 'geom', {**shape, **where, **through})


def _joint(name: str, body: Body, limits: Array, written: _Written) -> ElementTree.Element:
    values = {'armature': body.motor_inertia, **written.joints.get(name, {})}
    attributes = {key: repr(float(value)) for key, value in values.items() if value}
    if np.all(np.isfinite(limits)) and limits[0] < limits[1]:
        attributes['range'] = _text(limits)
        attributes['limited'] = 'true'
    kind = 'slide' if body.is_prismatic else 'hinge'
    own = {'name': name, 'type': kind, 'axis': _text(body.axis), **attributes}
    return ElementTree.Element('joint', own)


def _add_motors(root: ElementTree.Element, robot: Robot, written: _Written) -> None:
    actuators = ElementTree.SubElement(root, 'actuator')
    for name, limit in zip(robot.arm, robot.effort_limits.tolist(), strict=False):
        if name in robot.passive_joints:
            continue
        attributes = {'name': name, 'joint': name, 'gear': repr(written.gains.get(name, 1.0))}
        if math.isfinite(limit):
            attributes |= {'ctrllimited': 'true', 'ctrlrange': _text([-limit, limit])}
        ElementTree.SubElement(actuators, 'motor', attributes)
    for thruster in robot.thrusters:
        own = {'name': _free(thruster.name, robot.arm), 'site': _free(thruster.name, ['base'])}
        gear = [*(thruster.force * thruster.direction), 0.0, 0.0, 0.0]
        share = {'ctrllimited': 'true', 'ctrlrange': '0 1'}
        ElementTree.SubElement(actuators, 'motor', {**own, 'gear': _text(gear), **share})


def _add_sensors(root: ElementTree.Element, robot: Robot, written: _Written, step: float) -> None:
    """Noise is what MuJoCo keeps for its users: it adds none by itself."""
    sensors = ElementTree.SubElement(root, 'sensor')

    def add(kind: str, late: str, channel: str, **attributes: str) -> None:
        std = robot.sensors.std(channel)
        if std:
            attributes['noise'] = repr(std)
        if delay := written.delays.get(late, 0.0):
            attributes['delay'] = repr(delay)
            attributes['nsample'] = str(math.ceil(delay / step) + 2)
            attributes['interp'] = 'linear'
        ElementTree.SubElement(sensors, kind, attributes)

    for name in robot.arm:
        add('jointpos', 'joint', 'joint_position', name=f'{name}_position', joint=name)
        add('jointvel', 'joint', 'joint_velocity', name=f'{name}_velocity', joint=name)
        if name not in robot.passive_joints:
            add('actuatorfrc', 'effort', 'joint_effort', name=f'{name}_effort', actuator=name)
    if robot.is_free:
        add('gyro', 'gyro', 'gyro', name='gyro', site='base')
        add('framequat', 'attitude', 'attitude', name='attitude', objtype='site', objname='base')


def _add_start(
    root: ElementTree.Element, robot: Robot, balls: Sequence[_Ball], file: RobotFile
) -> None:
    """The keyframe `start`: as a simulation begins, wheels that spin included."""
    initial = file.settings.initial
    arm = [body.name for body in robot.bodies[1:]]
    places = dict(zip(arm, initial.joint_position, strict=False))
    rates = dict(zip(arm, initial.joint_velocity, strict=False))
    rates |= {rotor.body.name: rotor.rate for rotor in robot.rotors[: robot.rotor_count]}
    rates |= {ball.body.name: ball.rate for ball in balls}
    order = [body.name for body in _depth_first(robot, balls)]
    position, velocity = ([of.get(name, 0.0) for name in order] for of in (places, rates))
    if robot.is_free:
        attitude = np.array(initial.attitude_xyzw) / np.linalg.norm(initial.attitude_xyzw)
        position = [0.0, 0.0, 0.0, *np.roll(attitude, 1).tolist(), *position]
        velocity = [0.0, 0.0, 0.0, *initial.angular_velocity, *velocity]
    keys = ElementTree.SubElement(root, 'keyframe')
    ElementTree.SubElement(keys, 'key', name='start', qpos=_text(position), qvel=_text(velocity))


def _depth_first(robot: Robot, balls: Sequence[_Ball], at: int = 0) -> list[Body]:
    """Bodies with joints below one, in MuJoCo's order: as they stand in the file."""
    out = [ball.body for ball in balls if ball.host == at]
    for i, body in enumerate(robot.bodies):
        if body.parent == at:
            out += [body, *_depth_first(robot, balls, i)]
    return out


def _free(name: str, taken: Sequence[str]) -> str:
    """A name that none of its kind has."""
    while name in taken:
        name += '_'
    return name


def _text(values: Array | Sequence[float]) -> str:
    return ' '.join(repr(float(value)) for value in values)
