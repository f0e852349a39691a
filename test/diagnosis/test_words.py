"""What a sentence says of a cause: the numbers that are clear."""

from __future__ import annotations

import math

import pytest

from spacerobot_ros.diagnosis.answer.cause import Cause, Estimated, Evidence
from spacerobot_ros.diagnosis.answer.words import cause_in_words, telling
from spacerobot_ros.effects.catalogue import CATALOGUE

LIFTED = {
    'mass': Estimated(value=2.0, std=0.2, unit='kg'),
    'mx': Estimated(value=0.1, std=0.01, unit='kg m'),
}
SWUNG = {  # as 0.2 kg half a metre from an axis, on an arm that counterweights hold
    'mass': Estimated(value=0.0, std=1.8, unit='kg'),
    'mx': Estimated(value=2e-4, std=0.014, unit='kg m'),
    'my': Estimated(value=0.099, std=0.016, unit='kg m'),
    'mz': Estimated(value=-0.007, std=0.02, unit='kg m'),
    'izz': Estimated(value=0.065, std=0.013, unit='kg m^2'),
}


@pytest.mark.parametrize(
    ('found', 'said'),
    [
        (LIFTED, ['mass']),
        (SWUNG, ['my']),  # the mass may be nothing, and is not what changed
        ({'mass': Estimated(value=1.0, std=math.nan, unit='kg')}, ['mass']),
    ],
)
def test_the_numbers_of_a_body_that_are_clear(found, said):
    assert list(telling(found)) == said


def test_a_law_of_which_one_part_is_nothing():
    kind = CATALOGUE['joint_coupled_friction']
    values = {'coulomb': 0.0, 'viscous': 0.06, 'ratio': 1.0}
    cause = Cause(
        applied=kind(name='found', where='j', values=values),
        parameters={
            'coulomb': Estimated(value=0.0, std=0.012, unit='N m'),
            'viscous': Estimated(value=0.06, std=0.01, unit='N m s/rad'),
            'ratio': Estimated(value=1.0, std=math.nan, unit=''),
        },
        evidence=Evidence(),
        thresholds={},
        relevant=True,
    )
    words = cause_in_words(cause, is_short=True)
    assert words.endswith('at j (viscous 0.06 +- 0.01 N m s/rad)')


def test_a_cause_of_which_one_axis_is_told():
    kind = CATALOGUE['gyro_bias']
    cause = Cause(
        applied=kind(name='found', where=None, values={'x': 0.0, 'y': 0.0, 'z': 0.01}),
        parameters={'z': Estimated(value=0.01, std=0.001, unit='rad/s')},
        evidence=Evidence(),
        thresholds={},
        relevant=True,
    )
    assert cause_in_words(cause, is_short=True).endswith('(z 0.01 +- 0.001 rad/s)')
