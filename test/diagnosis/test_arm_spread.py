"""What is printed of an arm's causes is true, and decides which of them have a name."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from spacerobot_ros.diagnosis.answer.cause import Estimated
from spacerobot_ros.diagnosis.arms import arm_spread
from spacerobot_ros.diagnosis.arms.fitted_arm import FittedArm
from spacerobot_ros.diagnosis.limits import CHANCE
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.columns import candidate_at
from spacerobot_ros.inference.decisive import CLUSTERS
from spacerobot_ros.inference.gram import Gram
from spacerobot_ros.inference.gram_blocks import GramBlocks
from validation.hidden.real_arm import arm_file

KEEP, DRIVE = 0.97, 0.05  # of a leftover from row to row, tens of rows long; [N m]
COULOMB, MORE, SLOW = 1.0, 0.3, 0.4  # N m, N m, rad/s


def fit_of(grams, kinds, *, variant=None):
    """A `FittedArm` of wide priors whose candidates are all chosen, of whitened blocks."""
    robot = arm_file().robot
    found = [candidate_at(CATALOGUE[kind], robot, 'joint_1', variant or {}) for kind in kinds]
    ends = np.cumsum([0, *(len(c.sizes) for c in found)])
    rows = SimpleNamespace(
        candidates=found,
        places=[np.arange(a, b) for a, b in pairwise(ends)],
        sizes=np.full(ends[-1], 1e3),
        balances=[SimpleNamespace(effects=())],
        robot=robot,
    )
    blocks = GramBlocks(int(ends[-1]))
    for gram in grams:
        blocks.add_sums(gram)
    return FittedArm(rows, blocks, tuple(range(len(found))))


def found_of(fit):
    """All that is asked of an `ArmFound`."""
    return SimpleNamespace(fit=fit, clear=fit.chosen, named=[*fit.effects(fit.chosen)])


def stribeck_fit(rng):
    """Friction that falls with the rate, in a leftover with a memory, whitened as it is."""
    rate = 0.5 * np.sin(np.linspace(0.0, 60.0, 1500))
    columns = np.sign(rate)[:, None] * np.column_stack(
        [np.ones_like(rate), np.exp(-((rate / SLOW) ** 2))]
    )
    left = lfilter([DRIVE], [1.0, -KEEP], rng.standard_normal(2000))[500:]
    torque = columns @ [COULOMB, MORE] + left
    white = [(x[1:] - KEEP * x[:-1]) / DRIVE for x in (columns, torque)]
    cut = zip(*(np.array_split(x, CLUSTERS) for x in white), strict=True)
    grams = [Gram.of(*block) for block in cut]
    return fit_of(grams, ['joint_stribeck_friction'], variant={'velocity': SLOW})


def test_deviations_of_laws_of_several_numbers_know_how_these_go_together(rng):
    """The static torque is a sum of two numbers that are off in opposite ways.

    Of 300 draws the deviation of an estimate is known to 4 %; those of 30 blocks, never below
    the model's own, are 5 % wider in the mean.
    """
    every = [found_of(stribeck_fit(rng)) for _ in range(300)]
    values = np.array([[f.named[0]['coulomb'], f.named[0]['static']] for f in every])
    stds = np.mean([arm_spread.values_std(f, 0)[:2] for f in every], axis=0)
    np.testing.assert_allclose(stds, np.std(values, axis=0), rtol=0.15)
    np.testing.assert_allclose(np.mean(values, axis=0), [COULOMB, COULOMB + MORE], atol=0.05)


def correlated(correlation):
    """A fit of a law with two numbers, each of deviation 1 and 1.5 from nothing."""
    precision = np.linalg.inv(np.array([[1.0, correlation], [correlation, 1.0]]))
    vector = precision @ [1.5, 1.5]
    grams = [Gram(precision / CLUSTERS, vector / CLUSTERS, 30.0, 30)] * CLUSTERS
    return fit_of(grams, ['joint_stribeck_friction'], variant={'velocity': SLOW})


def test_covariances_are_those_of_the_coefficients_by_their_parameters():
    """Coulomb a and static friction a + b; what was put together of several causes has none."""
    found = found_of(correlated(-0.8))
    stds = zip(('coulomb', 'static'), arm_spread.values_std(found, 0), strict=False)
    own = {name: Estimated(value=1.0, std=std, unit='N m') for name, std in stds}
    causes = [SimpleNamespace(applied=found.named[0], parameters=own)]
    said = arm_spread.covariance_of(found, causes)
    law = 'joint_stribeck_friction/joint_1'
    assert said.names == (f'{law}/coulomb', f'{law}/static')
    np.testing.assert_allclose(said.matrix, [[1.0, 0.2], [0.2, 0.4]], rtol=1e-4)
    put_together = SimpleNamespace(id='joint_asymmetric_friction', where='joint_2')
    put_together.key, put_together.parameters = ('joint_asymmetric_friction', 'joint_2'), ()
    forward = {'forward': Estimated(value=1.0, std=0.1, unit='N m')}
    causes.append(SimpleNamespace(applied=put_together, parameters=forward))
    both = arm_spread.covariance_of(found, causes)
    assert np.all(np.isnan(both.matrix[2, :2]))
    assert both.matrix[2, 2] == pytest.approx(0.01)
    assert arm_spread.covariance_of(found, []) is None


@pytest.mark.parametrize(('sign', 'clear'), [(1.0, True), (-1.0, False)])
def test_a_cause_is_clear_as_a_whole(sign, clear):
    """Two numbers, each 1.5 deviations off: with opposite errors one of the two must be there.

    Correlated by -0.8 their sum is 4.7 deviations off, by 0.8 it is 1.6.
    """
    fit = correlated(-0.8 * sign)
    assert (fit.chance(0) < CHANCE) is clear
