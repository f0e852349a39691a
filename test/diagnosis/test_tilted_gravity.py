"""A tilt of gravity is told in two axes; its size, which no tilt changes, is held."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from spacerobot_ros.diagnosis.answer.cause import Cause, Estimated, Evidence
from spacerobot_ros.diagnosis.answer.words import cause_in_words
from spacerobot_ros.diagnosis.arms.arm_spread import values_std
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.real_arm import RealArm, arm_file

VALUES = {'x': 0.4, 'y': 1.2, 'z': -4e-8}
GRAVITY = CATALOGUE['gravity_error'](name='tilt', where=None, values=VALUES)


def test_the_sentence_has_both_axes():
    found = {name: Estimated(value=v, std=0.01, unit='m/s^2') for name, v in VALUES.items()}
    cause = Cause(
        applied=GRAVITY, parameters=found, evidence=Evidence(), thresholds={}, relevant=True
    )
    short = cause_in_words(cause, is_short=True)
    assert short.endswith('(x 0.4 +- 0.01 m/s^2, y 1.2 +- 0.01 m/s^2)')
    assert 'z -4e-08' in cause_in_words(cause)


def test_what_is_held_has_no_standard_deviation():
    file = arm_file()
    record = RealArm(4).record(0, ('joint_2',), 5.0)
    balance = balance_of(observed(record, file.robot), file.robot, file.effects)
    rows = ArmRows.of([balance], [CATALOGUE['gravity_error']])
    fit = SimpleNamespace(
        rows=rows,
        values=np.array([0.4, 1.2, 0.0]),
        spread=lambda i: np.full(3, 0.01),
        covariance=lambda columns: np.diag(np.full(3, 0.01**2)),
    )
    found = SimpleNamespace(fit=fit, clear=(0,), named=(GRAVITY,))
    x, y, z = values_std(found, 0)
    np.testing.assert_allclose([x, y], 0.01, rtol=1e-9)
    assert math.isnan(z)
