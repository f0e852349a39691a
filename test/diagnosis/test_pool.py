"""Candidates on columns alone: which are companions, which variant is the first guess."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.search.pool import Judged, Pool
from spacerobot_ros.diagnosis.search.ranking import ranked
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.columns import Candidate
from spacerobot_ros.estimation.inference.evidence import Gram, Score

ROWS = 400


def candidate(effect, where, frequency=3.0):
    one, wide = np.ones(1), np.full(1, 100.0)
    return Candidate(
        CATALOGUE[effect], where, {'frequency': frequency}, ({},), one, one, -wide, wide
    )


def test_rivals_are_not_taken_together_and_companions_are(rng):
    truth, other, noise, one, two = rng.standard_normal((5, ROWS))
    near, nearer = truth + 0.5 * one, truth + 0.4 * two  # columns as far off as those of bodies
    data = 2.0 * truth + 2.0 * other + noise
    columns = np.column_stack([near, nearer, other])
    candidates = tuple(candidate('joint_stiffness', f'joint_{k}') for k in (1, 2, 3))
    parts = [Gram.of(columns[k::5], data[k::5]) for k in range(5)]
    found = Pool(candidates, tuple(parts), 0, np.zeros(0)).together(10.0)
    assert {j.candidate.where for j in found} == {'joint_2', 'joint_3'}


@pytest.mark.parametrize(('gap', 'frequency'), [(1.0, 4.0), (50.0, 30.0)])
def test_of_frequencies_that_are_alike_the_smallest_effect_is_the_first_guess(gap, frequency):
    """A stiff spring with most of the body does what a soft one with little of it does."""
    values = {4.0: (100.0, 0.01), 30.0: (100.0 + gap, 0.7)}
    judged = [
        Judged(
            candidate('grasp_compliance', 'antenna', at),
            Score(evidence, 200.0, 1.0, 0.0, 190.0, 150.0, np.array([share])),
        )
        for at, (evidence, share) in values.items()
    ]
    (first,) = ranked(judged)
    assert first.candidate.variant['frequency'] == frequency
