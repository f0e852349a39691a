"""Friction that several laws share, in the level of what is left."""

from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.arms import levels_of
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from validation.hidden.real_arm import COULOMB, RealArm, arm_file

KINDS = ('joint_coulomb_friction', 'joint_stribeck_friction')


@pytest.fixture(scope='module')
def rows():
    """An arm with the friction of its joints, which the model has not."""
    balance = balance_of(RealArm(4).record(0), arm_file().robot, ())
    return ArmRows.of([balance], [CATALOGUE[kind] for kind in KINDS])


@pytest.fixture(scope='module')
def laws(rows):
    """Numbers of both laws at the first joint."""
    keys = [candidate.key for candidate in rows.candidates]
    return [keys.index((kind, 'joint_1')) for kind in KINDS]


def test_laws_that_share_a_friction_drift_as_their_sum(laws, rows, monkeypatch):
    """Not as one of their sizes, of which one may be less than nothing."""
    used = []
    monkeypatch.setattr(
        'spacerobot_ros.diagnosis.arms.arms.leftover_levels',
        lambda rows, deviations, friction: used.append(friction) or [],
    )
    shared = np.zeros(len(rows.sizes))
    for i, share in zip(laws, (3.0, -2.0), strict=True):
        shared[rows.places[i][0]] = share * COULOMB[0]
    levels_of(rows, SimpleNamespace(chosen=laws, mean=shared))
    assert used[0][0] == pytest.approx(COULOMB[0])
