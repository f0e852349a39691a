"""Joints that stick while they turn round: what friction does there is no shape of friction."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.arms import find_arm_causes
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.arm_levels import leftover_levels
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

URDF = """<robot name="gantry">
  <link name="base_link"/>
  <link name="car"><inertial><mass value="8"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="x" type="prismatic"><parent link="base_link"/><child link="car"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="300" velocity="2"/></joint>
</robot>"""
MASS, DRY, WET = 8.0, 12.0, 20.0  # kg, N, N s/m
TURNS, STEP = 24, 1e-3  # turns of a recording; s
STICK, DELAY = 0.12, 0.015  # s
KINDS = ('coulomb', 'viscous', 'presliding', 'stribeck')


@pytest.fixture(scope='module')
def robot():
    own = {'base': 'fixed', 'joints': ['x'], 'gravity': [0.0, 0.0, -9.81]}
    return build_robot(parse_settings({'robot': own}), URDF)


def record_of(rng, stick, delay=0.0):
    """Swings of 0.5 to 1.5 s that stick at their ends, where friction goes over to its other side.

    Args:
        rng: Of the lengths of swings and of the noise.
        stick: How long at each end [s].
        delay: Of the efforts [s].
    """
    parts, last, way = [], -0.3, 1.0
    for half in rng.uniform(0.5, 1.5, TURNS):
        t = np.arange(0.0, half, STEP)
        w = np.pi / half
        reach = 0.5 * half * rng.uniform(0.4, 0.8)
        q = last + way * reach * 0.5 * (1.0 - np.cos(w * t))
        qd, qdd = way * reach * 0.5 * w * np.sin(w * t), way * reach * 0.5 * w**2 * np.cos(w * t)
        parts.append(np.column_stack([q, MASS * qdd + way * DRY + WET * qd]))
        last += way * reach
        hold = np.linspace(parts[-1][-1, 1], -way * DRY, round(stick / STEP))
        parts.append(np.column_stack([np.full(len(hold), last), hold]))
        way = -way
    q, effort = np.concatenate(parts).T
    at = np.arange(50, len(q), 5)
    q, effort = q[at], effort[at - round(delay / STEP)]
    effort = effort + 0.02 * rng.standard_normal(len(at))
    q = q + 1e-5 * rng.standard_normal(len(at))
    joints = JointSeries(('x',), to_stamps(STEP * at), q[:, None], None, effort[:, None])
    return Record(joints=joints)


def test_what_friction_does_at_rest_is_in_no_row(robot, rng):
    """Within 2 % of the friction; a quarter of it before rests of 0.12 s were seen and bridged."""
    dry = CATALOGUE['joint_coulomb_friction'](name='c', where='x', values={'torque': DRY})
    wet = CATALOGUE['joint_viscous_friction'](name='v', where='x', values={'coefficient': WET})
    balance = balance_of(record_of(rng, STICK), robot, [dry, wet])
    moving = balance.arm.is_moving[:: balance.arm.stride]
    assert 0.4 < np.mean(moving) < 0.9
    assert np.sqrt(np.mean(balance.torque[moving] ** 2)) < 0.02 * DRY


def test_the_level_counts_turns_that_noise_hides(robot, rng):
    """Sticks of 20 ms: too short to see, and no wider level of what is left elsewhere."""
    dry = CATALOGUE['joint_coulomb_friction'](name='c', where='x', values={'torque': DRY})
    balance = balance_of(record_of(rng, 0.02), robot, [dry])
    rows = ArmRows.of([balance], [CATALOGUE['joint_viscous_friction']])
    (level, _) = leftover_levels(rows, rows.sizes, rows.friction)
    spread = rows.joints[0].rms(level)
    near = np.abs(rows.joints[0].observed[:, 3]) > 1.0
    assert np.median(spread[near]) > 3.0 * np.median(spread[~near])


@pytest.mark.parametrize('delay', [0.0, DELAY])
def test_dry_friction_is_named_as_it_is(robot, rng, delay):
    """Within a tenth of the 5 % from run to run; a shape of it is no surer than itself."""
    kinds = [CATALOGUE[f'joint_{kind}_friction'] for kind in KINDS] + [CATALOGUE['effort_delay']]
    found = find_arm_causes([record_of(rng, STICK, delay)], robot, (), kinds, lambda *_: None)
    named = {e.id: next(iter(e.values.values())) for e in found.named}
    dry = named.pop('joint_coulomb_friction', None)
    if dry is None:
        dry = named.pop('joint_stribeck_friction')
        kinds_of = {i: c.kind.id for i, c in enumerate(found.fit.rows.candidates)}
        (shaped,) = (
            c for i, c in found.causes.items() if kinds_of[i].endswith('stribeck_friction')
        )
        others = [{kinds_of[i] for i in rival.causes} for rival in shaped.rivals]
        assert {'joint_coulomb_friction'} in others
    assert dry == pytest.approx(DRY, rel=0.02)
    truth = {'joint_viscous_friction': WET} | ({'effort_delay': delay} if delay else {})
    assert named == pytest.approx(truth, rel=0.02)
