"""A search that costs too much ends, and says so."""

from __future__ import annotations

import pytest

from spacerobot_ros.campaign.diagnosis_scenario import robot_file, simulated
from spacerobot_ros.diagnosis import search
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect

FRICTION = 'joint_viscous_friction'
UNFINISHED = 'before all that stands out'


@pytest.mark.parametrize(('most', 'is_named'), [(1, False), (10_000, True)])
def test_a_search_ends_with_its_budget_and_says_so(monkeypatch, most, is_named):
    monkeypatch.setattr(search, 'MOST_MODELS', most)
    robot = robot_file('servicer').robot
    hidden = bind_effect('hidden', FRICTION, robot.joints[0], {'coefficient': 5.0}, robot)
    record = simulated('servicer', 'default', 3, [hidden], 6.0)
    said = diagnose(record, robot, catalogue=[CATALOGUE[FRICTION]])
    assert bool(said.causes) == is_named
    assert any(UNFINISHED in note for note in said.notes) != is_named
