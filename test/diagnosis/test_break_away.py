"""Friction of a joint that breaks away from rest: what it holds before is no push."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.events.arm_events import break_away
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

URDF = """<robot name="motor">
  <link name="base_link"/>
  <link name="disc"><inertial><mass value="0.1"/>
    <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="axis" type="continuous"><parent link="base_link"/><child link="disc"/>
    <axis xyz="0 0 1"/><limit effort="7" velocity="10"/></joint>
</robot>"""
DRY, BREAKS, INERTIA, STEP = 0.12, 0.21, 1e-3, 0.01  # N m, N m, kg m^2, s
REST, GOES = 2.5, 4.0  # s
PUSH = 0.8  # N m


@pytest.fixture(scope='module')
def robot():
    own = {'base': 'fixed', 'joints': ['axis'], 'gravity': [0.0, 0.0, -9.81]}
    return build_robot(parse_settings({'robot': own}), URDF)


def record_of(rng, push=0.0):
    """Motions there and back; before each the torque grows until the joint slides by itself.

    Args:
        rng: Of the motions and the noise.
        push: Of somebody in the middle of the third rest [N m].
    """
    rest, t = np.arange(0.0, REST, STEP), np.arange(0.0, GOES, STEP)
    parts, last = [], 0.0
    for k, speed in enumerate(rng.uniform(0.5, 3.0, 8)):
        way = (-1.0) ** k
        held = way * BREAKS * (1.9 * rest / REST - 0.9)
        if k == 2:
            held = held - push * np.sin(np.pi * np.clip(rest - 0.7, 0.0, 1.0)) ** 2
        parts.append(np.column_stack([np.full(len(rest), last), held]))
        w = 2.0 * np.pi / GOES
        q = last + way * speed * (t - np.sin(w * t) / w)
        parts.append(np.column_stack([q, INERTIA * way * speed * w * np.sin(w * t) + way * DRY]))
        last = q[-1]
    q, effort = np.concatenate(parts).T
    q = q + 1e-5 * rng.standard_normal(len(q))
    effort = effort + 0.005 * rng.standard_normal(len(q))
    stamps = to_stamps(STEP * np.arange(len(q)))
    return Record(joints=JointSeries(('axis',), stamps, q[:, None], None, effort[:, None]))


def test_torques_of_all_starts(robot, rng):
    """A tenth is lost to the filter, which rounds the peak."""
    found = break_away([balance_of(record_of(rng), robot, ())])
    assert found == pytest.approx([BREAKS], rel=0.1)


def test_what_a_joint_bears_before_it_starts_is_no_event(robot, rng):
    """It starts from 1.75 times what its dry friction leaves of a motion."""
    found = diagnose(record_of(rng), robot)
    assert found.events.named == ()
    (law,) = found.friction
    assert law.coulomb_forward == pytest.approx(DRY, rel=0.05)


def test_a_push_at_rest_is_an_event_still(robot, rng):
    found = diagnose(record_of(rng, PUSH), robot)
    (event,) = found.events.named
    middle = 3.0 * REST + 2.0 * GOES - REST + 1.2
    assert 0.5 * (event.start + event.end) == pytest.approx(middle, abs=0.1)
    assert abs(event.peak['axis'] - PUSH) < BREAKS


def test_a_joint_that_is_pushed_about_tells_nothing(robot, rng):
    """It moves too little to be judged, against its motor."""
    record = record_of(rng)
    still = record.between(0.1, 2.4)
    assert break_away([balance_of(still, robot, ())]) == pytest.approx([0.0])
