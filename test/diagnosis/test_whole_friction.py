"""A law that corrects named friction takes it as terms of its own, and energy with it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.diagnosis import friction_cause, hand_made

from spacerobot_ros.diagnosis import diagnose
from spacerobot_ros.diagnosis.answer.cause import Estimated
from spacerobot_ros.diagnosis.answer.result import Leftover
from spacerobot_ros.diagnosis.discovery.discover import feeds_energy
from spacerobot_ros.diagnosis.discovery.discover_in_flight import corrected_by, with_friction
from spacerobot_ros.effects.catalogue import bind_effect
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.rows import ChannelFit
from validation.hidden.diagnosis_scenario import robot_file

HALF = 3.0  # N m s/rad, that `friction_cause` names at joint_2: of 6 one way and none back
BOTH = 'sign(x), x, |x|'


def motion():
    """Joint_2 there and back."""
    robot, time = robot_file('servicer').robot, np.linspace(0.0, 10.0, 500)
    q, qd = np.zeros((2, len(time), robot.n_joints))
    q[:, 1], qd[:, 1] = np.sin(time), np.cos(time)
    return Motion(robot, time, q, qd, np.zeros_like(q))


def said(form, coefficients):
    """A law of joint_2's rate beside that friction."""
    values = {
        'form': form,
        'inputs': ['rate/joint_2'],
        'coefficients': coefficients,
        'range': {'rate/joint_2': [-1.0, 1.0]},
        'limit': 100.0,
        'kind': 'external',
    }
    return Leftover(
        channel='joint_torque/joint_2',
        depends_on=('rate/joint_2',),
        resembles='friction',
        form=form,
        coefficients=tuple(Estimated(value=c, std=0.1, unit='N m') for c in coefficients),
        applied=bind_effect(
            'law', 'learned_torque', 'joint_2', values, robot_file('servicer').robot
        ),
    )


def test_friction_of_one_way_is_one_law():
    """Named as half of it both ways, a law that pushes on the way back: together -3 (x + |x|)."""
    along, entry, (cause,) = motion(), said(BOTH, [0.0, 0.0, -HALF]), (friction_cause(),)
    assert corrected_by(entry.applied, [cause]) == [cause]
    whole = with_friction(entry, [cause], along)
    assert whole.kind == whole.applied.kind == 'dissipative'
    assert [c.value for c in whole.coefficients] == pytest.approx([0.0, -HALF, -HALF])
    assert not feeds_energy(whole.applied, [along])
    assert whole.applied.is_known_ahead
    assert whole.applied.limit == pytest.approx(1.49 * 2.0 * HALF, rel=1e-3)  # at 1 rad/s
    both = [e.force(along, np.zeros((len(along), 0))) for e in (cause.applied, entry.applied)]
    alone = whole.applied.force(along, np.zeros((len(along), 0)))
    np.testing.assert_allclose(alone, np.sum(both, axis=0), atol=1e-9)


def test_a_law_that_pushes_with_all_friction_is_not_applied():
    entry = said(BOTH, [0.0, 0.0, -10.0 * HALF])
    assert with_friction(entry, [friction_cause()], motion()).applied is None


def test_a_law_without_such_a_term_takes_no_friction():
    assert not corrected_by(said('x |x|', [1.0]).applied, [friction_cause()])


def test_the_sentence_has_the_law_and_not_the_friction_that_it_took(monkeypatch):
    answer = replace(hand_made('partly_explained'), fit_p=0.0)
    said_now = replace(answer, causes=(), leftover=(said(BOTH, [0.0, -HALF, -HALF]),))
    monkeypatch.setattr(diagnose, 'conclude', lambda found, notes: answer)
    monkeypatch.setattr(diagnose, 'discover_in_flight', lambda answer, fit, report: said_now)
    slow = ChannelFit(
        channel='gyro', axis=0, spread=1.0, p_value=0.0, question='slow', frequency=1.0, line_p=1.0
    )
    fit = SimpleNamespace(
        rows=SimpleNamespace(whiteness=lambda: (0.0, (slow,))), run=SimpleNamespace(timing='')
    )
    found = SimpleNamespace(fit=fit, sound=fit)
    sentence = diagnose._concluded(found, (), lambda what, share: None).sentence
    assert 'viscous friction in a joint' not in sentence
    assert sentence.endswith('joint_torque/joint_2 goes with rate/joint_2 like friction.')
