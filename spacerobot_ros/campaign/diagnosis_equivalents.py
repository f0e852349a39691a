"""Effects that no record tells apart: naming one where the other was hidden is no error.

Only what follows from the equations counts, at the same place: one effect is a special or limiting
case of the other. Confusions of single motions are not in the list: there the diagnosis must name
the rival itself.
"""

from __future__ import annotations

EQUIVALENTS: tuple[tuple[str, str, str], ...] = (
    ('torque_sensor_bias', 'joint_stiffness', 'a spring of no stiffness, k q0 kept'),
    (
        'joint_coulomb_friction',
        'joint_stribeck_friction',
        'static torque as the Coulomb one',
    ),
    ('motor_inertia', 'joint_flexibility', 'a gear without flexibility'),
    ('external_torque_body', 'thruster_leak', 'no force at a long lever, the torque kept'),
    ('free_wheel_rotors', 'inertial_parameters', 'the inertia of the rotors taken from the link'),
    ('inertial_parameters', 'fuel_slosh', 'no spring: the fuel taken from the body'),
    ('inertial_parameters', 'flexible_appendage', 'no spring: the panel taken from the body'),
    ('inertial_parameters', 'grasp_compliance', 'no spring: the share taken from the last body'),
)
"""(narrower, wider, what of the wider one the narrower one is). Late clocks are not among them:
joints late by t look like gyro and tracker early by t, which no delay is."""

_PAIRS = {frozenset(entry[:2]) for entry in EQUIVALENTS}


def is_equivalent(one: tuple[str, str | None], other: tuple[str, str | None]) -> bool:
    """Whether two effects with their places are the same, or declared equivalents there."""
    return one[1] == other[1] and (one[0] == other[0] or {one[0], other[0]} in _PAIRS)
