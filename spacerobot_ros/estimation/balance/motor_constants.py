"""Currents whose torque nobody states: motor constants, estimated beside everything else.

A current i gives K i. Beside a model of the joint whose scale is known K is one more column; what
is not known is found by going round: torques of a first K are balanced, and K grows by the gain
that the balance wants of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...effects.joints.motors import MotorConstant
from ...errors import RecordingError
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..filters.torque_process import TorqueDriven
from .arm_motion import ArmMotion

TORQUE = 'torque'
"""As an anchor of the scale of all torques: some are measured."""
_LEAST = 0.1  # of a current's variance that the model's torque must explain, friction allowed for


def as_recorded(robot: Robot, records: Sequence[Record]) -> Robot:
    """The robot with what recordings say of its joints: motors, rates alone, currents.

    Raises:
        RecordingError: a joint has a motor in one recording and none in another.
    """
    joints = [record.joints for record in records if record.joints is not None]
    if not joints:
        return robot
    passive = [set(series.passive) for series in joints]
    for record, own in zip(records, passive, strict=True):
        if own != passive[0]:
            names = ', '.join(sorted(own ^ passive[0]))
            raise RecordingError(
                record.source or 'recordings',
                f'{names}: without a motor here or in the first recording, not in both',
            )
    currents = {name for series in joints for name in series.in_amperes}
    kinds = zip(robot.arm, robot.effort_kinds, strict=True)
    driven = [joint for joint in robot.arm if joint not in passive[0]]
    return replace(
        robot,
        passive_joints=tuple(joint for joint in robot.arm if joint in passive[0]),
        rate_only=tuple(j for j in robot.arm if any(j in s.rate_only for s in joints)),
        effort_kinds=tuple('current' if joint in currents else kind for joint, kind in kinds),
        anchor=robot.anchor if currents.issuperset(driven) else TORQUE,
    )


def in_newton_metres(
    record: Record, robot: Robot, effects: Sequence[Effect]
) -> tuple[Record, Robot, tuple[Effect, ...]]:
    """Currents as torques by the motor constants among the effects, which the robot takes over.

    Raises:
        RecordingError: one of them has no constant.
    """
    joints = record.joints
    if joints is None or joints.effort is None or not joints.in_amperes:
        return record, robot, tuple(effects)
    known = {e.where: e['constant'] for e in effects if isinstance(e, MotorConstant)}
    lacking = [joint for joint in joints.in_amperes if joint not in known]
    if lacking:
        raise RecordingError(
            record.source or 'efforts',
            f'currents of {", ".join(lacking)} are no torques: state robot.motor_constant',
        )
    constants = np.array(
        [known[j] if j in joints.in_amperes else 1.0 for j in joints.names], dtype=float
    )
    believed = np.where(constants == 1.0, robot.known_effort_units, constants)
    return (
        replace(record, joints=replace(joints, effort=joints.effort * constants, in_amperes=())),
        replace(robot, motor_constants=tuple(believed.tolist())),
        tuple(
            e
            for e in effects
            if not (isinstance(e, MotorConstant) and e.where in joints.in_amperes)
        ),
    )


def first_constants(
    records: Sequence[Record], robot: Robot, believed: Sequence[Effect]
) -> tuple[Effect, ...]:
    """Motor constants of currents that no believed effect makes torques, by the model as it is.

    Raises:
        RecordingError: a current that has nothing to do with the torque that the model asks for.
    """
    stated = {e.where for e in believed if isinstance(e, MotorConstant)}
    wanted = {j for r in records if r.joints is not None for j in r.joints.in_amperes} - stated
    process = TorqueDriven(robot, [e for e in believed if not isinstance(e, MotorConstant)])
    arms = [ArmMotion(record) for record in records]
    return tuple(
        MotorConstant(
            name=f'motor_constant_{joint}',
            where=joint,
            values={'constant': _first(arms, process, joint)},
        )
        for joint in robot.arm
        if joint in wanted
    )


def _first(arms: Sequence[ArmMotion], process: TorqueDriven, joint: str) -> float:
    """Torque that the model asks for by the current that there is, friction and zero beside it."""
    j = process.robot.joints.index(joint)
    found: list[list[Array]] = [[], [], []]
    for arm in arms:
        motion = process.motion(arm.kinematics, np.zeros_like(arm.kinematics.q))
        needed = (process.needed(motion) - process.forces(motion))[:, 6 + j]
        qd = arm.kinematics.qd[:, j]
        beside = np.column_stack([np.sign(qd), qd, np.ones_like(qd)])
        rows = arm.is_moving[:, j]
        for own, values in zip(found, (arm.effort[:, j], needed, beside), strict=True):
            own.append(arm.in_band(values)[rows])
    currents, torques, others = map(np.concatenate, found)
    both = _without(others, np.column_stack([currents, torques]))
    (ii, it), (_, tt) = both.T @ both
    if it <= 0.0 or it**2 < _LEAST * ii * tt:
        raise RecordingError(
            f'currents of {joint}',
            'do not go with the torque that the model asks for, so that they tell no motor '
            'constant: state robot.motor_constant, or record a motion that accelerates (is the '
            'sign of the currents right?)',
        )
    return float(tt / it)


def _without(columns: Array, values: Array) -> Array:
    """Values less what columns explain of them."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values)[0])


def scaled_constant(effect: Effect, gain: float) -> Effect:
    """A motor constant that is larger by a gain."""
    return replace(effect, values={'constant': gain * effect['constant']})
