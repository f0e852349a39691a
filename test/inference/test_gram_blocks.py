"""Sums over blocks, and which of them are held out together."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.inference.decisive import CLUSTERS
from spacerobot_ros.inference.gram import Gram, sum_of
from spacerobot_ros.inference.gram_blocks import NEVER_HELD_OUT, GramBlocks, merged
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis


def test_blocks_of_rows_and_of_sums_say_the_same(rng):
    X, y = rng.standard_normal((70, 12)), rng.standard_normal(70)
    by_rows, by_sums = GramBlocks(12), GramBlocks(12)
    for own in np.split(np.arange(70), [5, 40]):  # fewer rows than columns, and more
        by_rows.add(X[own], y[own])
        by_sums.add_sums(Gram.of(X[own], y[own]))
    want = Gram.of(X, y)
    for blocks in (by_rows, by_sums):
        np.testing.assert_allclose(blocks.whole.matrix, want.matrix, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(blocks.whole.vector, want.vector, rtol=0.0, atol=1e-12)
        assert blocks.whole.square == pytest.approx(want.square)
    columns = np.array([1, 4, 11])
    for one, other in zip(by_rows.grams(columns), by_sums.grams(columns), strict=True):
        np.testing.assert_allclose(one.matrix, other.matrix, rtol=0.0, atol=1e-12)
        assert one.rows == other.rows


def test_sums_of_columns_that_are_placed_are_those_of_their_rows(rng):
    X, y = rng.standard_normal((40, 3)), rng.standard_normal(40)
    places = np.array([2, -1, 0, 2])
    by_sums, by_rows = GramBlocks(4), GramBlocks(4)
    by_sums.add_sums(Gram.of(X, y), places=places)
    by_rows.add(X[:, places] * (places >= 0), y)
    for one, other in zip(by_sums.grams(np.arange(4)), by_rows.grams(np.arange(4)), strict=True):
        np.testing.assert_allclose(one.matrix, other.matrix, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(one.vector, other.vector, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(by_sums.whole.matrix, by_rows.whole.matrix, rtol=0.0, atol=1e-12)
    assert parts(by_sums, 1) == [-1]
    assert parts(by_sums, 3) == [0]


def blocks_that_tell(*recordings: int, told: tuple[int, ...] = ()) -> GramBlocks:
    """Two columns; only the first is seen in blocks that do not tell of the second."""
    blocks = GramBlocks(2)
    for k, recording in enumerate(recordings):
        blocks.add(np.array([[1.0, float(k in told)]] * 3), np.ones(3), recording)
    return blocks


def parts(blocks: GramBlocks, column: int) -> list[int]:
    return blocks.parts(np.array([column]), np.ones(1)).tolist()


def test_recordings_judge_where_two_or_more_tell():
    blocks = blocks_that_tell(0, 0, 1, 1, 2, told=(0, 4))
    assert parts(blocks, 0) == [0, 0, 1, 1, 2]
    assert parts(blocks, 1) == [0, 0, -1, -1, 1]


def test_runs_of_blocks_judge_in_one_recording():
    assert parts(blocks_that_tell(*[0] * 9), 0) == [0, 0, 1, 1, 2, 2, 3, 4, 5]
    blocks = blocks_that_tell(0, 0, 0, 1, told=(0, 2))
    assert parts(blocks, 1) == [0, -1, 1, -1]


def test_what_holds_everything_is_never_held_out():
    blocks = blocks_that_tell(0, 1)
    blocks.add(np.array([[1e3, 0.0]]), np.zeros(1), NEVER_HELD_OUT)
    assert parts(blocks, 0) == [0, 1, -1]


def test_a_part_sums_its_blocks():
    grams = [Gram(np.eye(1) * k, np.zeros(1), 0.0, k) for k in range(5)]
    assert [g.rows for g in merged(grams, np.array([1, -1, 0, 0, 1]))] == [5, 4]


def test_a_block_of_other_columns_is_refused():
    with pytest.raises(ValueError, match='a block of 3 columns, not 2'):
        GramBlocks(2).add(np.zeros((4, 3)), np.zeros(4))


def test_rows_of_single_precision_are_kept_in_clusters(rng):
    X, y = rng.standard_normal((200, 7)).astype(np.float32), rng.standard_normal(200)
    wide = X.astype(float)
    blocks = GramBlocks.of_rows(X, y, wide.T @ wide)
    columns = np.array([0, 3])
    own = blocks.grams(columns)
    assert len(own) == CLUSTERS
    assert sum(gram.rows for gram in own) == blocks.whole.rows == len(y)
    want, found = Gram.of(wide, y), sum_of(own)
    np.testing.assert_allclose(blocks.whole.vector, want.vector, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.vector, want.vector[columns], rtol=0.0, atol=1e-12)
    matrix = want.matrix[np.ix_(columns, columns)]
    np.testing.assert_allclose(found.matrix, matrix, rtol=0.0, atol=1e-12)


def test_what_is_only_the_rounding_of_large_columns_tells_nothing(rng):
    """Of a body that is nearly none: nine columns of 1e9 within six directions, beside others."""
    six = rng.standard_normal((1440, 6)) @ rng.standard_normal((6, 9))
    X = np.column_stack([six * 10.0 ** rng.uniform(8.0, 9.5, 9), six[:, :2] * 1e8])
    X = X.astype(np.float32)
    wide, y = X.astype(float), rng.standard_normal(len(X))
    body = Hypothesis(key='body', columns=np.arange(9), slab=np.full(9, 0.5), spike=np.zeros(9))
    others = [
        Hypothesis(key=k, columns=np.array([k]), slab=np.array([0.5]), spike=np.zeros(1))
        for k in (9, 10)
    ]
    hypotheses = Hypotheses(GramBlocks.of_rows(X, y, wide.T @ wide), [body, *others])
    nothing = hypotheses.marginal(()).log_density
    for chosen in [0], [0, 1], [0, 1, 2]:
        assert hypotheses.marginal(chosen).log_density < nothing
