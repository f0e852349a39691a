"""What is printed of an arm's causes is true, and decides which of them have a name."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from spacerobot_ros.diagnosis.arms import arm_spread
from spacerobot_ros.diagnosis.arms.arm_found import is_clear
from spacerobot_ros.diagnosis.limits import ALIKE
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.arm_fit import ArmFit
from spacerobot_ros.estimation.columns import candidate_at
from spacerobot_ros.estimation.inference.evidence import Gram
from validation.hidden.real_arm import arm_file

KEEP, DRIVE = 0.97, 0.05  # of a leftover from row to row, tens of rows long; [N m]
COULOMB, MORE, SLOW = 1.0, 0.3, 0.4  # N m, N m, rad/s


def fit_of(gram, kinds, *, variant=None):
    """An `ArmFit` of wide priors whose candidates are all chosen."""
    robot = arm_file().robot
    found = [candidate_at(CATALOGUE[kind], robot, 'joint_1', variant or {}) for kind in kinds]
    ends = np.cumsum([0, *(len(c.sizes) for c in found)])
    count = int(ends[-1])
    rows = SimpleNamespace(
        candidates=found,
        places=[np.arange(a, b) for a, b in pairwise(ends)],
        sizes=np.ones(count),
        deviations=lambda chosen: np.full(count, 1e3),
        lower=np.full(count, -np.inf),
        upper=np.full(count, np.inf),
        robot=robot,
        is_tolerated=lambda i: False,
    )
    return ArmFit(rows, gram, tuple(range(len(found))))


def found_of(fit):
    """All that is asked of an `ArmFound`."""
    return SimpleNamespace(
        fit=fit, clear=fit.chosen, named=[*fit.effects(fit.chosen)], learned=(), records=[0, 0]
    )


def stribeck_fit(rng):
    """Friction that falls with the rate, in a leftover with a memory, whitened as it is."""
    rate = 0.5 * np.sin(np.linspace(0.0, 60.0, 1500))
    columns = np.sign(rate)[:, None] * np.column_stack(
        [np.ones_like(rate), np.exp(-((rate / SLOW) ** 2))]
    )
    left = lfilter([DRIVE], [1.0, -KEEP], rng.standard_normal(2000))[500:]
    torque = columns @ [COULOMB, MORE] + left
    white = [(x[1:] - KEEP * x[:-1]) / DRIVE for x in (columns, torque)]
    return fit_of(Gram.of(*white), ['joint_stribeck_friction'], variant={'velocity': SLOW})


def test_deviations_of_laws_of_several_numbers_know_how_these_go_together(rng):
    """The static torque is a sum of two numbers that are off in opposite ways.

    Of 300 draws the deviation of an estimate is known to 4 %.
    """
    every = [found_of(stribeck_fit(rng)) for _ in range(300)]
    values = np.array([[f.named[0]['coulomb'], f.named[0]['static']] for f in every])
    stds = np.mean([arm_spread.values_std(f, 0, 1.0)[:2] for f in every], axis=0)
    np.testing.assert_allclose(stds, np.std(values, axis=0), rtol=0.15)
    np.testing.assert_allclose(np.mean(values, axis=0), [COULOMB, COULOMB + MORE], atol=0.05)


@pytest.mark.parametrize(('sign', 'clear'), [(1.0, True), (-1.0, False)])
def test_a_cause_is_clear_as_a_whole(sign, clear):
    """Two numbers, each 1.5 deviations off: with opposite errors one of the two must be there.

    Correlated by -0.8 their sum is 4.7 deviations off, by 0.8 it is 1.6.
    """
    correlation = np.array([[1.0, -0.8 * sign], [-0.8 * sign, 1.0]])
    precision = np.linalg.inv(correlation)
    gram = Gram(precision, precision @ [1.5, 1.5], 0.0, 1000)
    fit = fit_of(gram, ['joint_stribeck_friction'], variant={'velocity': SLOW})
    assert is_clear(fit, 0) is clear


@pytest.mark.parametrize(
    ('values', 'scatter', 'clear'),
    [
        ((2.8, 3.2), (1.0, 1.0), (0, 1)),
        ((2.8, 3.2), (8.0, 3.0), (1,)),  # printed as 1.8 and 2.1 deviations
        ((1.9, 2.1), (1.0, 3.0), (1,)),
    ],
)
def test_a_name_is_judged_by_what_is_printed(monkeypatch, values, scatter, clear):
    """Both have the same scatter between parts, of two recordings alone or of four quarters."""
    gram = Gram(np.eye(2), np.array(values), 0.0, 1000)
    fit = fit_of(gram, ['joint_coulomb_friction', 'joint_viscous_friction'])
    found = found_of(fit)
    monkeypatch.setattr(arm_spread, 'scatter_of', lambda found, i: scatter)
    usual = arm_spread.usual_scatter(found)
    printed = [
        arm_spread.values_std(found, i, arm_spread.birge_of(found, i, usual)) for i in (0, 1)
    ]
    ratios = [value / std[0] for value, std in zip(values, printed, strict=True)]
    assert tuple(np.flatnonzero(np.array(ratios) > 2.0)) == clear
    assert arm_spread.clear_causes(found) == clear


def test_scatter_of_two_parts_has_next_to_no_size(monkeypatch):
    """One cause differs between two recordings, ten do not: it is a little less certain."""
    scatters = {i: (16.0, 1.0) if i == 0 else (0.45, 1.0) for i in range(11)}
    monkeypatch.setattr(arm_spread, 'scatter_of', lambda found, i: scatters[i])
    found = SimpleNamespace(fit=SimpleNamespace(chosen=tuple(scatters)))
    usual = arm_spread.usual_scatter(found)
    assert usual == pytest.approx(1.0, abs=0.02)  # the middle of a chi-square is 0.455
    assert arm_spread.birge_of(found, 1, usual) == 1.0
    alone = np.sqrt((16.0 + ALIKE) / (1.0 + ALIKE))
    assert arm_spread.birge_of(found, 0, usual) == pytest.approx(alone, rel=0.01)
