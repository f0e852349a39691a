"""Which way an arm of unknown noise is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis import diagnose
from spacerobot_ros.diagnosis.answer.result import Diagnosis
from spacerobot_ros.diagnosis.search import predictable
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from validation.hidden.real_arm import JOINTS, RealArm, arm_file


def test_a_part_is_tried_in_which_the_joints_go_furthest():
    time = np.arange(6000) / 100.0
    lively = np.where((time > 30.0) & (time < 40.0), np.sin(3.0 * time), 0.1 * np.sin(time))
    q = np.column_stack([lively, 0.05 * lively])
    record = Record(joints=JointSeries(('a', 'b'), to_stamps(time), q, None, q))
    part = predictable._liveliest(record)
    assert len(part.joint_time) == 1000
    assert part.joint_time[0] == pytest.approx(30.0, abs=0.1)
    short = record.between(-1.0, 5.0)
    assert predictable._liveliest(short) is short


@pytest.mark.parametrize('verdict', ['unexplained', 'partly_explained', 'explained'])
def test_where_prediction_has_no_answer_the_balance_has(monkeypatch, verdict):
    of_prediction = Diagnosis(verdict=verdict, sentence='of the prediction')
    monkeypatch.setattr(diagnose, 'is_predictable', lambda *_: True)
    monkeypatch.setattr(diagnose, '_predicted', lambda *_: of_prediction)
    file = arm_file(has_friction=False)
    record = RealArm(2).record(0, moving=JOINTS[1:2], duration=12.0)
    said = diagnose.diagnose(record, file.robot)
    is_of_prediction = said.sentence == of_prediction.sentence
    assert is_of_prediction == (verdict == 'explained')
    if not is_of_prediction:
        assert {c.applied.where for c in said.causes} == {'joint_2'}


@pytest.mark.parametrize(('seed', 'coefficient'), [(2, 20.0), (3, 5.0)])
def test_torques_that_do_not_follow_from_the_model_have_no_gain(seed, coefficient):
    """Somebody guides a joint whose motor makes up for friction only: a gain of ten was named."""
    file, record = arm_file(), RealArm(seed).record(0, duration=12.0)
    efforts = record.effort.copy()
    efforts[:, 1] = coefficient * np.gradient(record.q[:, 1], record.joint_time)
    guided = replace(record, joints=replace(record.joints, effort=efforts))
    found = diagnose.diagnose(guided, file.robot, file.effects)
    assert found.verdict in ('unexplained', 'partly_explained')
    assert not any(c.applied.id == 'joint_torque_constant' for c in found.causes)


def test_a_gain_of_torques_that_do_follow_is_named_still():
    file, record = arm_file(), RealArm(2).record(0, duration=12.0)
    efforts = record.effort.copy()
    efforts[:, 1] *= 0.4
    found = diagnose.diagnose(
        replace(record, joints=replace(record.joints, effort=efforts)), file.robot, file.effects
    )
    gains = [c for c in found.causes if c.applied.id == 'joint_torque_constant']
    assert [c.applied.where for c in gains] == [JOINTS[1]]
    assert gains[0].parameters['gain'].value == pytest.approx(2.5, rel=0.1)
