"""Effects that no record tells apart: what follows from their equations, not from a motion."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..model.robot import Robot
from .catalogue import CATALOGUE
from .effect import Key

EQUIVALENTS: tuple[tuple[str, str, str], ...] = (
    ('torque_sensor_bias', 'joint_stiffness', 'a spring of no stiffness, k q0 kept'),
    ('torque_sensor_bias', 'joint_torque_ripple', 'a harmonic of nothing, A sin phi kept'),
    ('joint_stiffness', 'joint_torque_ripple', 'a harmonic of nothing, its slope A k kept'),
    ('joint_coulomb_friction', 'joint_stribeck_friction', 'static torque as the Coulomb one'),
    ('joint_coulomb_friction', 'joint_presliding_friction', 'no displacement'),
    ('joint_coulomb_friction', 'joint_coupled_friction', 'a ratio of nothing, no viscous part'),
    ('joint_viscous_friction', 'joint_coupled_friction', 'a ratio of nothing, no dry part'),
    ('joint_stiffness', 'joint_presliding_friction', 'a displacement beyond the motion, T/d kept'),
    ('motor_inertia', 'joint_flexibility', 'a gear without flexibility'),
    ('external_torque_body', 'thruster_leak', 'no force at a long lever, the torque kept'),
    ('free_wheel_rotors', 'inertial_parameters', 'the inertia of the rotors taken from the link'),
    ('inertial_parameters', 'fuel_slosh', 'no spring: the fuel taken from the body'),
    ('inertial_parameters', 'flexible_appendage', 'no spring: the panel taken from the body'),
    ('inertial_parameters', 'grasp_compliance', 'no spring: the share taken from the last body'),
)
"""(narrower, wider, what of the wider one the narrower one is): effects that no record tells
apart, so that naming one where the other was hidden is no error. Only what follows from the
equations counts, at the same place: one effect is a special or limiting case of the other.
Confusions of single motions are not in the list: there the diagnosis must name the rival itself.
Late clocks are not, either: joints late by t look like gyro and tracker early by t, which no delay
is."""


_TURNED = {
    'attitude_misalignment': 'gyro_misalignment',
    'gyro_misalignment': 'attitude_misalignment',
}


def made_of(robot: Robot, effect: str, where: str | None) -> tuple[set[Key], set[Key]]:
    """Effects that together are another one: those that have to be there, and further ones.

    All joints late by t are each of them late by t. With an encoder at the end of an arm that says
    d too much the last body is turned by d about its joint, as R(q) = R(q + d) R(-d), and with it
    the momentum of wheels in it. A soft grasp is, to first order in rates and deflections, the
    mass of its part at the body's centre on springs, as fuel is, and its inertia on springs about
    three axes, as panels are, where a record shows that. With a tracker turned by r the base frame
    may be called turned: the tracker is right, the gyro's rates are turned by r, and so are the
    base body, its wheels, and the first joints about their axes; across these an arm's mount is
    tilted, which nothing in the catalogue does, so that where a record shows it these causes leave
    something. With a turned gyro it is the tracker that is turned, by -r, and they as much.
    """
    if effect == 'joint_delay':
        return {('joint_sensor_delay', joint) for joint in robot.joints}, set()
    if effect == 'grasp_compliance':
        return {('fuel_slosh', where)}, {('flexible_appendage', where)}
    if effect in _TURNED:
        moving = zip(robot.joints, robot.bodies[1:], strict=True)
        first = {('encoder_offset', joint) for joint, body in moving if body.parent == 0}
        base = ('inertial_parameters', robot.bodies[0].name)
        wheels = ('servicer_wheel_momentum_error', None)
        return {(_TURNED[effect], None)}, {*first, base, wheels}
    if effect != 'encoder_offset':
        return set(), set()
    body = 1 + robot.joints.index(str(where))
    name = robot.bodies[body].name
    if name not in robot.last_links:
        return set(), set()
    within = [g for g in robot.target_wheels if g.body == body and np.any(g.momentum)]
    turned = {('target_wheel_momentum', g.link) for g in within}
    return {('inertial_parameters', name), *turned}, set()


def unasked(robot: Robot, named: Collection[Key], asked: Collection[str]) -> tuple[str, ...]:
    """What named effects may stand for by their equations, and were not compared with.

    Args:
        robot: The robot.
        named: The effects.
        asked: Kinds of effects that were looked for.
    """
    pairs = [*EQUIVALENTS, *((wider, narrower, why) for narrower, wider, why in EQUIVALENTS)]
    notes = [
        f'{_in_words((one, where))} may be {other}: {why}'
        for one, where in named
        for own, other, why in pairs
        if own == one and other not in asked and where in CATALOGUE[other].fitted_places(robot)
    ]
    wholes = [('joint_delay', None), *(('encoder_offset', joint) for joint in robot.joints)]
    if 'grasp_compliance' not in asked:  # with fuel and panels it is the same to first order only
        wholes += [('grasp_compliance', link) for link in robot.last_links]
    for whole in wholes:
        parts, _ = made_of(robot, *whole)
        if parts and parts <= set(named):
            notes.append(
                f'{" and ".join(map(_in_words, sorted(parts)))} may be {_in_words(whole)}'
            )
    return tuple(f'{note}; by their equations no record tells' for note in notes)


def _in_words(key: Key) -> str:
    return key[0] if key[1] is None else f'{key[0]} at {key[1]}'
