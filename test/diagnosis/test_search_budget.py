"""A search ends when it costs too much, and says so; obvious causes do not use it up."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.search import search
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from validation.hidden.diagnosis_scenario import robot_file, simulated

FRICTION = 'joint_viscous_friction'
UNFINISHED = 'before all that stands out was looked into'
WHEELS, DRY = 'servicer_wheel_drag', 'joint_coulomb_friction'
TOGETHER = {WHEELS: (None, {'time_constant': 2000.0}), DRY: ('joint_1', {'torque': 0.55})}


@pytest.mark.parametrize(('most', 'is_named'), [(1, False), (10_000, True)])
def test_a_search_ends_with_its_budget_and_says_so(monkeypatch, most, is_named):
    monkeypatch.setattr(search, 'MOST_MODELS', most)
    robot = robot_file('servicer').robot
    hidden = bind_effect('hidden', FRICTION, robot.joints[0], {'coefficient': 5.0}, robot)
    record = simulated('servicer', 'default', 3, [hidden], 4.0)
    said = diagnose(record, robot, catalogue=[CATALOGUE[FRICTION]])
    assert bool(said.causes) == is_named
    (note,) = [note for note in said.notes if UNFINISHED in note] or ['']
    assert bool(note) != is_named
    for channel in ('joint velocity 1', 'gyro 3'):  # friction takes from both at once
        assert (f'a slow error in {channel}' in note) != is_named


def test_wheels_that_run_down_beside_dry_friction_cost_few_models(monkeypatch):
    """One after the other, each fitted beside what the other leaves, they take 120."""
    monkeypatch.setattr(search, 'MOST_MODELS', 20)
    robot = robot_file('servicer').robot
    hidden = [
        bind_effect(f'hidden_{effect}', effect, where, values, robot)
        for effect, (where, values) in TOGETHER.items()
    ]
    record = simulated('servicer', 'default', 3, hidden)
    said = diagnose(record, robot)
    assert said.verdict == 'explained', said.sentence
    found = {c.applied.id: c for c in said.causes}
    assert {id_: c.applied.where for id_, c in found.items()} == {
        id_: where for id_, (where, _) in TOGETHER.items()
    }
    for id_, (_, values) in TOGETHER.items():
        for name, truth in values.items():
            estimated = found[id_].parameters[name]
            assert abs(estimated.value - truth) <= 4.0 * estimated.std  # two numbers, one draw


@pytest.mark.parametrize(
    ('effect', 'where', 'delay'),
    [('joint_delay', None, 3.946e-4), ('joint_sensor_delay', 'joint_2', 5e-4)],
)
def test_late_clocks_are_no_steps_of_the_momentum(effect, where, delay):
    """The clock of all joints, or of one; its misses are steep where the motion turns."""
    robot = robot_file('minisat').robot
    hidden = bind_effect('hidden', effect, where, {'delay': delay}, robot)
    kinds = [CATALOGUE[e] for e in ('joint_delay', 'joint_sensor_delay', 'gyro_bias')]
    said = diagnose(simulated('minisat', 'slow', 902, [hidden]), robot, catalogue=kinds)
    assert not said.events.named
    (cause,) = (*said.causes, *said.minor)
    assert (cause.applied.id, cause.applied.where) == (effect, where)
    found = cause.parameters['delay']
    assert abs(found.value - delay) <= 4.0 * found.std


def test_turns_that_tell_ever_less_end_a_search():
    """Three ends, each with less evidence than the one before; one that tells more starts anew."""

    def ends_at(*evidences):
        fits = [SimpleNamespace(fit=SimpleNamespace(evidence=value)) for value in evidences]
        record = SimpleNamespace(joint_time=np.array([0.0, 20.0]))
        turns = search.Search(Mock(record=record), (), Mock())
        return [turns._goes_down(found) for found in fits]

    assert ends_at(-366.0, -380.0, -447.0) == [False, False, True]
    assert ends_at(-366.0, -380.0, -370.0, -375.0, -376.0) == [False, False, False, False, True]
    assert not any(ends_at(-5.0, -4.0, -3.0, -2.0))
