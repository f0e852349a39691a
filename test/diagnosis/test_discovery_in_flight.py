"""What the leftover of a free flyer depends on: a law of a joint, or nothing."""

from __future__ import annotations

import numpy as np
import pytest
from support.diagnosis import hand_made

from spacerobot_ros.campaign.diagnosis_scenario import robot_file, simulated
from spacerobot_ros.diagnosis.discovery.discover_in_flight import discover_in_flight
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.observations import observed
from spacerobot_ros.estimation.refit import Fit
from spacerobot_ros.estimation.runs import Run

ROBOT, SECONDS = 'minisat', 8.0
DRAG = 0.02  # N m s^2/rad^2


def leftover(**hidden):
    """What is said where the model as it stands is asked, no cause chosen before."""
    file = robot_file(ROBOT)
    effects = bind_effects({'hidden': hidden} if hidden else {}, file.robot)
    record = observed(simulated(ROBOT, 'fast', 5, effects, SECONDS), file.robot)
    noise, _ = noise_levels(file.robot.sensors, record)
    run = Run(record, file.robot, file.effects, noise, 'held_before')
    return discover_in_flight(hand_made('unexplained'), Fit(run, ()), lambda what, share: None)


def laws(answer):
    return {e.channel: e for e in answer.leftover if e.form is not None}


@pytest.fixture(scope='module')
def joint():
    return robot_file(ROBOT).robot.arm[1]


def test_drag_of_a_joint_is_found_there_alone(joint):
    rates = np.linspace(-8.0, 8.0, 321)
    answer = leftover(
        effect='learned_torque',
        where=joint,
        form='table',
        inputs=[f'rate/{joint}'],
        knots={'x': rates.tolist()},
        values=(-DRAG * rates * np.abs(rates)).tolist(),
        range={f'rate/{joint}': [-8.0, 8.0]},
        limit=10.0,
        kind='dissipative',
    )
    ((channel, entry),) = laws(answer).items()
    assert answer.verdict == 'partly_explained'
    assert channel == f'joint_torque/{joint}'
    assert entry.depends_on == (f'rate/{joint}',)
    assert entry.form == 'x |x|'
    assert entry.coefficients[0].value == pytest.approx(-DRAG, rel=0.1)
    assert entry.applied.kind == 'dissipative'


def test_a_right_model_has_no_law():
    assert not laws(leftover())
