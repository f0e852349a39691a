"""From rows to causes on synthetic rows: names at the stated rates, probabilities that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import poisson
from support.drawn_hypotheses import drawn

from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypothesis import Hypothesis
from spacerobot_ros.inference.inferred import infer

SMALL = {'collinear': 0.3, 'rows': 360}


def test_records_without_causes_have_names_as_rarely_as_stated():
    """The prior gives a record any cause in 5 %; evidence and validation leave fewer of chance."""
    false = [
        bool(infer(p.sums, p.every).causes)
        for p in (
            drawn([seed, 1], count=15, odds=0.0, is_cause=0.0, size=0.2, bounded=0.3, **SMALL)
            for seed in range(120)
        )
    ]
    assert sum(false) <= poisson.ppf(0.999, 120 * 0.01)


@pytest.fixture(scope='module')
def found():
    """Records of weak and strong causes, drawn as often as the odds say."""
    out = []
    for seed in range(100):
        # log odds of 2 - 3 - ln 12: one in 33, so a third of the records has one
        share = 1.0 / (1.0 + np.exp(-(2.0 - 3.0 - np.log(12))))
        p = drawn([seed, 2], count=12, odds=2.0, is_cause=share, size=0.2, **SMALL)
        out.append((p, infer(p.sums, p.every)))
    return out


def test_probabilities_are_as_often_right_as_they_say(found):
    causes = [(c, int(c.key.split()[1]) in p.causes) for p, f in found for c in f.causes]
    wrong = sum(not is_right for _, is_right in causes)
    expected = sum(1.0 - c.probability for c, _ in causes)
    assert len(causes) > 15
    assert poisson.ppf(0.005, expected) <= wrong <= poisson.ppf(0.995, expected)


def test_deviations_cover_the_truth(found):
    z = []
    for p, f in found:
        names = {f'effect {i}' for i in p.causes} & {c.key for c in f.causes}
        if names == {c.key for c in f.causes} and f.covariance is not None:
            own = f.covariance.columns
            z += ((f.mean - p.coefficients)[own] / f.covariance.deviations).tolist()
    # some 40 values: the standard error of their rms is 0.11
    assert np.sqrt(np.mean(np.square(z))) < 1.3


def test_what_is_said_is_of_one_set(found):
    for _, f in found:
        assert f.verdict in ('consistent', 'explained')
        assert len(f.density) == 6
        assert [c.log_odds for c in f.causes] == sorted(c.log_odds for c in f.causes)[::-1]
        for c in f.causes:
            assert c.probability == pytest.approx(1.0 / (1.0 + np.exp(-c.log_odds)))
            assert np.sum(c.gains) > 3.0
            np.testing.assert_array_equal(c.values, f.mean[c.hypothesis.columns])
        assert f.goodness.is_good


def two_columns(rng: np.random.Generator, data) -> tuple[GramBlocks, list[Hypothesis]]:
    columns = rng.standard_normal((600, 2))
    values = data(columns) + rng.standard_normal(600)
    blocks = GramBlocks(2)
    for own in np.split(np.arange(600), 30):
        blocks.add(columns[own], values[own])
    one, none = np.ones(1), np.zeros(1)
    return blocks, [
        Hypothesis(key=k, columns=np.array([k]), slab=one, spike=none) for k in range(2)
    ]


def test_what_fails_on_other_parts_is_excluded_and_the_search_goes_on():
    def data(columns):
        blip = np.zeros(600)
        blip[100:110] = 20.0 * np.sign(columns[100:110, 0])
        return blip + 0.5 * columns[:, 1]

    found = infer(*two_columns(np.random.default_rng(1), data))
    assert found.excluded == {0}
    assert [c.key for c in found.causes] == [1]


def test_what_is_refused_is_excluded_and_the_search_goes_on():
    """With all else that it asked for: the set is then that of hypotheses without it."""
    problem = drawn([3, 4], count=12, odds=2.0, is_cause=0.4, size=2.0, **SMALL)
    first, *_ = infer(problem.sums, problem.every).causes
    found = infer(
        problem.sums,
        problem.every,
        refused=lambda h, now: [i for i in now.chosen if h.every[i].key == first.key],
    )
    never = [replace(h, log_odds=-np.inf) if h.key == first.key else h for h in problem.every]
    assert first.key in found.excluded
    assert {c.key for c in found.causes} == {c.key for c in infer(problem.sums, never).causes}


def test_misfit_and_implausible_values_are_said(rng):
    assert infer(*two_columns(rng, lambda x: 0.0 * x[:, 0])).verdict == 'consistent'
    squared = two_columns(rng, lambda x: 3.0 * x[:, 0] * x[:, 1])
    assert infer(*squared).verdict == 'unexplained'
    assert infer(*two_columns(rng, lambda x: 2.0 * x[:, 0])).verdict == 'explained'
    blocks, every = two_columns(rng, lambda x: 2.0 * x[:, 0])
    narrow = [replace(h, slab=np.full(1, 0.3)) for h in every]
    beyond = infer(blocks, narrow)
    assert beyond.causes[0].slabs > 5.0
    assert beyond.verdict == 'partly_explained'


def test_what_is_always_in_is_fitted_and_not_named(rng):
    blocks, every = two_columns(rng, lambda x: x @ [0.5, 1.0])
    found = infer(blocks, [replace(every[0], log_odds=np.inf), every[1]])
    assert [c.key for c in found.causes] == [1]
    assert found.mean[0] == pytest.approx(0.5, abs=0.2)


def test_a_zero_of_one_recording_is_judged_by_its_parts(rng):
    """What no other recording knows can not be predicted from it; a shared cause must be."""
    columns = np.zeros((1200, 3))
    columns[:, 0] = rng.standard_normal(1200)
    columns[600:, 1] = 1.0  # a zero of the second recording
    columns[:, 2] = rng.standard_normal(1200)
    data = columns @ [0.5, 0.4, 0.0] + rng.standard_normal(1200)
    blocks = GramBlocks(3)
    for k, own in enumerate(np.split(np.arange(1200), 40)):
        blocks.add(columns[own], data[own], recording=k // 20)
    one, none = np.ones(1), np.zeros(1)
    found = infer(
        blocks,
        [Hypothesis(key=k, columns=np.array([k]), slab=one, spike=none) for k in range(3)],
    )
    assert {c.key: len(c.gains) for c in found.causes} == {0: 2, 1: 6}
