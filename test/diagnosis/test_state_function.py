"""What is a smooth function of a joint's state is less beside such functions; a push is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.events.naming import MovingArm
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from validation.hidden import real_arm
from validation.hidden.real_arm import COULOMB, POSE, RATE, RealArm, arm_file

JOINT, START, TORQUE = 4, 14.0, 5.0
KINDS = ('joint_coulomb_friction', 'inertial_parameters', 'joint_stiffness')


def swept(rng, time, _moves):
    """Every joint swings from 0.15 to 0.5 Hz, as in public recordings of a small arm."""
    size, offset = np.array([0.5, 0.4, 0.5, 0.6, 0.6, 0.6]), rng.uniform(-0.4, 0.4, 6)
    turn = 2.0 * np.pi * (0.15 + 0.175 * time / time[-1]) * time
    rate = 2.0 * np.pi * (0.15 + 0.35 * time / time[-1])
    q = POSE + offset + size * np.cos(turn)[:, None]
    qd = -size * (rate * np.sin(turn))[:, None]
    return q, qd, np.gradient(qd, time, axis=0)


def test_an_error_that_is_a_function_of_the_state_is_less_beside_one_and_a_push_is_not(
    monkeypatch,
):
    """A torque where the joint hardly turns or accelerates, most of it in the slow swings."""
    monkeypatch.setattr(real_arm, 'motion_of', swept)
    file, record = arm_file(), RealArm(34).record(0, duration=30.0)
    time, efforts = np.arange(len(record.effort)) / RATE, record.effort.copy()
    _, qd, qdd = swept(np.random.default_rng(0), time, None)
    efforts[:, JOINT] += COULOMB[JOINT] * np.exp(-(qd[:, JOINT] ** 2) - qdd[:, JOINT] ** 2 / 4.0)
    phase = np.clip(time - START, 0.0, 1.0)
    efforts[:, JOINT] -= TORQUE * np.sin(np.pi * phase) ** 2
    record = replace(record, joints=replace(record.joints, effort=efforts))
    balance = balance_of(record, file.robot, file.effects)
    rows = ArmRows.of([balance], [CATALOGUE[kind] for kind in KINDS])
    moving = MovingArm(rows)
    found = [p for p in moving.found if p.joint == JOINT]
    push, *errors = sorted(found, key=lambda p: -p.z)
    assert push.start == pytest.approx(START, abs=0.1)
    assert moving.beside_states(push) > 0.9 * push.z
    assert errors
    for error in errors:
        assert moving.beside_states(error) < 0.65 * error.z
