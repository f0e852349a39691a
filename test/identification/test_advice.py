"""Which extra motion would tell what a record could not."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support.identification import (
    H_TARGET,
    measure,
    servicer,
    simulate,
    truth_of,
)

from spacerobot_ros.cli.identify import _sections
from spacerobot_ros.display import Table
from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification import advice as advice_module
from spacerobot_ros.identification.advice import advise, advise_on, directions_in_words
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.settings import IdentifierSettings


def model_of(axes='zyx'):
    robot = servicer(axes)
    return MomentumModel(robot, minimal_set(robot, 'symmetric'))


@lru_cache
def with_joint_locked(joint):
    """Estimate from a run in which one joint stays where it is, and the advice on it."""
    record = measure(simulate('zyx', 20.0, f'locked_{joint}'), 1)
    model = model_of()
    estimate = identify(record, model.robot, IdentifierSettings())
    return estimate, advise_on(record, model, estimate)


@pytest.mark.parametrize('joint', [1, 2, 3])
def test_a_locked_joint_is_to_be_moved(joint):
    estimate, advice = with_joint_locked(joint)
    assert not estimate.valid
    assert advice[0].motion == f'move j_link_{joint}'
    assert all(f'j_link_{joint}' in one.motion for one in advice)
    assert sum(len(one.tells) for one in advice) == len(estimate.unexcited)


def test_two_bodies_that_never_moved_apart_are_told_as_a_sum():
    # Joint 3 turns about x: locked, bodies 2 and 3 keep only the sums of their inertias.
    _, advice = with_joint_locked(3)
    assert {frozenset(text.split(' with -1.00 ')) for text in advice[0].tells} == {
        frozenset({'J2yy', 'J3yy'}),
        frozenset({'J2xx', 'J3xx'}),
    }


def test_every_number_that_is_named_has_a_row():
    estimate, advice = with_joint_locked(3)
    groups = ['link'] * len(estimate.parameters)
    tables = [
        item
        for section in _sections(estimate, groups, advice)
        for item in section.items
        if isinstance(item, Table)
    ]
    rows = {row[0] for table in tables[:-1] for row in table.rows}
    text = f'{tables[-1].rows} {tables[-1].caption} {estimate.reason} {estimate.unexcited}'
    named = set(re.findall(r'\b(?:J\d|m\d|h_)\w+', text))
    assert named
    assert named <= rows
    example, _, _ = tables[-1].caption.strip('()').partition(':')
    assert example in {words for one in advice for words in one.tells}
    # nothing moves together: nothing to explain
    alone = [replace(one, tells=('J2xx alone',)) for one in advice]
    (*_, last) = _sections(estimate, groups, alone)
    assert not last.items[0].caption


def test_scale_asks_for_the_own_wheels():
    # Own wheels at rest: everything may grow in proportion, whatever else moves.
    model = model_of()
    unknowns = truth_of(simulate('zyx', 20.0))[3:]
    at_rest = model.robot.with_servicer_momentum(np.zeros(3))
    model = MomentumModel(at_rest, model.minimal)
    (advice,) = advise(model, unknowns, unknowns[None] / np.linalg.norm(unknowns), np.zeros(3))
    assert advice.motion == "spin up the servicer's wheels"
    assert 'only ratios are known otherwise' in advice.tells[0]


def test_motions_keep_the_limits_of_the_joints():
    limits = np.array([[-0.3, 0.1], [-9.0, 9.0], [0.2, 0.2]])
    robot = replace(
        servicer('zyx'), position_limits=limits, velocity_limits=np.array([9.0, 0.05, 9.0])
    )
    rest = np.array([0.05, -1.0, 0.2])
    q, qd = advice_module._swing(robot, advice_module._Probe((0, 1, 2)), rest)
    assert np.all((q >= limits[:, 0] - 1e-12) & (q <= limits[:, 1] + 1e-12))
    np.testing.assert_allclose(np.ptp(q, axis=0)[[0, 2]], [0.35, 0.0], rtol=0, atol=1e-3)
    assert 0.04 < np.abs(qd[:, 1]).max() <= 0.05
    model = MomentumModel(robot, minimal_set(robot, 'symmetric'))
    unknowns = np.concatenate([H_TARGET, model.prior()[model.x]])
    asked = advise(model, unknowns, np.eye(len(unknowns)), rest)
    assert asked[0].motion
    assert not any('j_link_3' in one.motion for one in asked)


def test_nothing_is_asked_for_where_all_is_known():
    model = model_of()
    unknowns = truth_of(simulate('zyx', 20.0))[3:]
    assert advise(model, unknowns, np.zeros((0, len(unknowns))), np.zeros(3)) == ()


def test_every_direction_is_told_once_or_said_to_be_left():
    # Parallel axes and nothing known: the arm alone leaves much, the last line holds what stays.
    model = model_of('zzz')
    count = model.n_aam + len(model.minimal)
    unknowns = np.concatenate([H_TARGET, model.prior()[model.x]])
    advice = advise(model, unknowns, np.eye(count), np.zeros(3))
    assert sum(len(one.tells) for one in advice) == count
    motions = [one.motion for one in advice]
    assert len(set(motions)) == len(motions)


def test_directions_are_sums_and_differences_of_few():
    directions = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]]) / 2.0
    texts = directions_in_words(directions, ('a', 'b', 'c'))
    assert sorted(texts) in (['a with +1.00 b', 'c alone'], ['b with +1.00 a', 'c alone'])
