"""A motor that two joints of a wrist turn, in moves from point to point."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from validation.hidden import real_arm
from validation.hidden.real_arm import COULOMB, VISCOUS, RealArm, arm_file

DRY, WET = 2.0, 0.6  # N m, N m s/rad of the sum of the two rates
MOVE, REST = 0.9, 0.1  # s


def moves(rng, time, is_moving):
    """Angles, rates and accelerations of synchronous moves, the last joint always the fastest."""
    count = int(time[-1] / (MOVE + REST)) + 1
    steps = rng.uniform(0.3, 0.6, (count, 6)) * rng.choice([-1.0, 1.0], (count, 6))
    steps[:, 5] *= 1.8 / 0.6
    move, part = np.divmod(time, MOVE + REST)
    s, move = np.minimum(part / MOVE, 1.0)[:, None], move.astype(int)
    before = np.vstack([np.zeros(6), np.cumsum(steps, axis=0)])[move]
    q = before + steps[move] * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    qd = steps[move] * 30.0 * (s**2 - 2.0 * s**3 + s**4) / MOVE
    qdd = steps[move] * 60.0 * (s - 3.0 * s**2 + 2.0 * s**3) / MOVE**2
    return real_arm.POSE + q * is_moving, qd * is_moving, qdd * is_moving


def coupled(record):
    """The record of an arm whose last motor turns the last two joints."""
    rate = np.gradient(record.q, record.joint_time, axis=0)
    both = rate[:, 4] + rate[:, 5]
    effort = record.joints.effort.copy()
    effort[:, 4:] += (DRY * np.tanh(both / 0.02) + WET * both)[:, None]
    return replace(record, joints=replace(record.joints, effort=effort))


def test_without_that_cause_both_joints_confirm_one_law(monkeypatch):
    monkeypatch.setattr(real_arm, 'motion_of', moves)
    file = arm_file()
    few = [CATALOGUE[f'joint_{name}_friction'] for name in ('coulomb', 'viscous')]
    record = coupled(RealArm(11).record(0, duration=12.0))
    answer = diagnose(record, file.robot, file.effects, few)
    assert not answer.causes
    (entry,) = (entry for entry in answer.leftover if entry.form)
    law = entry.applied
    assert {str(law.where), *law.guard.react} == {'joint_5', 'joint_6'}
    assert entry.form == 'sign(x + y), x + y'
    assert -sum(law.values.values()) == pytest.approx(DRY + WET, rel=0.15)


@pytest.mark.parametrize('is_coupled', [True, False])
def test_friction_of_a_motor_between_two_joints_is_found_as_such(is_coupled, monkeypatch):
    """The sum always turns as the faster joint does; the other one shows that it is a sum."""
    monkeypatch.setattr(real_arm, 'motion_of', moves)
    record = RealArm(11).record(0, duration=12.0)
    found = diagnose(coupled(record) if is_coupled else record, arm_file(has_friction=False).robot)
    causes = {(c.applied.id, c.applied.where): c.parameters for c in found.causes}
    law = causes.pop(('joint_coupled_friction', 'joint_6'), None)
    assert (law is not None) == is_coupled
    assert 'joint_coupled_friction' not in {kind for kind, _ in causes}
    if law:
        assert law['ratio'].value == 1.0
        assert law['coulomb'].value + law['viscous'].value == pytest.approx(DRY + WET, rel=0.15)
    for friction in found.friction:
        j = int(friction.joint[-1]) - 1
        own = friction.coulomb + 0.5 * friction.viscous
        assert own == pytest.approx(COULOMB[j] + 0.5 * VISCOUS[j], rel=0.15)
