"""Level of what no cause explains: whitening against a dense factor, REML on simulated rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from spacerobot_ros.estimation.balance.leftover import JointRows
from spacerobot_ros.estimation.balance.reml import _LevelRows, _Point, _settled, level_of

TIMES = np.array([0.3, 1.5, 8.0, 30.0, 30.0])
VARIANCES = np.array([0.04, 0.3, 0.2, 0.5, 0.1, 0.02])


def rows_at(rng, times, runs, columns=3):
    """Rows at given times of given recordings, with random content."""
    gap = np.diff(times, prepend=times[0])
    gap[np.flatnonzero(np.diff(runs)) + 1] = 0.0
    gap[0] = 0.0
    observed = np.column_stack(
        [np.sign(rng.standard_normal(len(times))), rng.standard_normal(len(times))]
    )
    return JointRows(
        rng.standard_normal(len(times)),
        rng.standard_normal((len(times), columns)),
        observed,
        np.asarray(runs),
        gap,
    )


def covariance(rows, times, variances):
    """Closed form: each recording for itself, rows of it correlated by their distance."""
    total = variances[0] * np.eye(len(times))
    own = np.cumsum(rows.gap == 0.0)
    same = own[:, None] == own
    seen = np.column_stack([np.ones((len(times), 3)), rows.observed])
    for k, memory in enumerate(TIMES):
        decay = np.exp(-np.abs(np.subtract.outer(times, times)) / memory)
        total += variances[1 + k] * same * decay * np.outer(seen[:, k], seen[:, k])
    return total


def test_whitening_is_a_dense_cholesky_factor(rng):
    """Rows are missing in the middle, and a second recording begins."""
    first = np.delete(0.1 * np.arange(60), np.r_[10:13, 30:45])
    times, runs = np.concatenate([first, 0.1 * np.arange(25)]), np.repeat([0, 1], [len(first), 25])
    rows = rows_at(rng, times, runs)
    torque, columns, logs = rows.whitened(VARIANCES)
    dense = covariance(rows, times, VARIANCES)
    factor = np.linalg.cholesky(dense)
    # rounding of some hundred recursions
    np.testing.assert_allclose(torque, np.linalg.solve(factor, rows.torque), rtol=0, atol=1e-10)
    np.testing.assert_allclose(columns, np.linalg.solve(factor, rows.columns), rtol=0, atol=1e-10)
    assert logs == pytest.approx(np.linalg.slogdet(dense)[1], abs=1e-9)


def test_blocks_of_a_recording_are_one_for_the_filter(rng):
    times = 0.1 * np.arange(40)
    one = rows_at(rng, times, np.zeros(40, dtype=int))
    parted = JointRows(one.torque, one.columns, one.observed, np.arange(40) // 10, one.gap)
    np.testing.assert_array_equal(one.whitened(VARIANCES)[0], parted.whitened(VARIANCES)[0])


def coloured(rng, count, step, memory):
    """A process of unit variance."""
    keep = np.exp(-step / memory)
    out = np.empty(count)
    out[0] = rng.standard_normal()
    for k in range(1, count):
        out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal()
    return out


def bare(torque, step):
    """Rows of one recording without columns."""
    count = len(torque)
    gap = np.full(count, step)
    gap[0] = 0.0
    return JointRows(
        torque, np.zeros((count, 1)), np.ones((count, 2)), np.zeros(count, dtype=int), gap
    )


def level(rows, scale):
    """Levels of rows whose friction and gain hardly drift."""
    return level_of(rows, np.ones(rows.columns.shape[1]), scale, np.full(2, 1e-3 * scale))


def test_white_noise_alone_has_the_white_level_alone(rng):
    found = level(bare(0.5 * rng.standard_normal(2000), 0.1), 10.0)
    # 1 / sqrt(2 * 2000) = 1.6 % of a standard deviation
    assert np.sqrt(found[0]) == pytest.approx(0.5, rel=0.05)
    assert np.sqrt(np.sum(found[1:])) < 0.1 * np.sqrt(found[0])


def test_a_coloured_level_is_recovered(rng):
    """With a white part of 0.1 and one of 1.5 s of 0.6, over 600 s."""
    found = np.array(
        [
            level(
                bare(0.1 * rng.standard_normal(3000) + 0.6 * coloured(rng, 3000, 0.2, 1.5), 0.2),
                10.0,
            )
            for _ in range(4)
        ]
    )
    slow = np.sqrt(np.mean(np.sum(found[:, 1:], axis=1)))
    # 600 s hold 200 independent values: 5 % of a standard deviation a run
    assert slow == pytest.approx(0.6, rel=0.1)
    # the processes overlap: the one of the memory that is there has the most of all runs
    assert np.argmax(np.mean(found[:, 1:], axis=0)) == 1


def test_what_the_columns_can_make_is_no_level(rng):
    """A large coefficient of a known shape is integrated out."""
    count, step = 1000, 0.1
    shape = np.sin(0.7 * step * np.arange(count))
    noise = 0.3 * rng.standard_normal(count)
    plain = bare(noise + 5.0 * shape, step)
    rows = JointRows(plain.torque, shape[:, None], plain.observed, plain.block, plain.gap)
    found = level_of(rows, np.array([10.0]), 10.0, np.full(2, 0.01))
    assert np.sqrt(np.sum(found)) == pytest.approx(0.3, rel=0.1)


def drifting(rng, count, columns=6):
    """Rows of two recordings, a pause in one, of all processes and some columns."""
    gap = np.full(count, 0.1)
    gap[[0, count // 2]], gap[count // 4] = 0.0, 0.7
    observed = np.column_stack(
        [np.sign(rng.standard_normal(count)), *rng.standard_normal((3, count))]
    )
    slow = coloured(rng, count, 0.1, 1.5) + coloured(rng, count, 0.1, 30.0) * observed[:, 0]
    torque = 0.3 * rng.standard_normal(count) + slow
    shapes = np.cumsum(rng.standard_normal((count, columns)), axis=0)
    return JointRows(torque, 0.1 * shapes, observed, np.zeros(count, dtype=int), gap)


def test_slopes_are_difference_quotients(rng):
    data, x = rows_of(drifting(rng, 300)), rng.uniform(-6.0, 0.0, 8)
    cost = [[_Point(data, x + s * d).cost for s in (1, -1)] for d in 1e-4 * np.eye(8)]
    # a third derivative of the size of the slopes, hundreds, by the square of the step
    quotients = -np.diff(cost)[:, 0] / 2e-4
    np.testing.assert_allclose(_Point(data, x).slope, quotients, rtol=1e-6, atol=1e-5)


def test_information_is_the_mean_of_observed_and_expected_curvature(rng):
    """y' P V_i P V_j P y, from dense matrices."""
    rows = drifting(rng, 60)
    times, x = np.cumsum(rows.gap) + 100.0 * (np.arange(60) >= 30), rng.uniform(-3.0, 0.0, 8)
    rows = replace(rows, observed=rows.observed[:, :2])
    x = x[:6]
    parts = [covariance(rows, times, v) for v in np.diag(np.exp(x))]
    inverse = np.linalg.inv(sum(parts))
    shapes = inverse @ rows.columns
    inner = np.linalg.inv(np.eye(6) + rows.columns.T @ shapes)
    projected = inverse - shapes @ inner @ shapes.T
    vectors = [part @ projected @ rows.torque for part in parts]
    dense = [[a @ projected @ b for b in vectors] for a in vectors]
    np.testing.assert_allclose(_Point(rows_of(rows), x).information, dense, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize('is_explained', [False, True])
def test_no_other_search_goes_lower(rng, is_explained):
    """Bounded quasi-Newton steps by slopes alone, from the same start and from where it ended.

    Where columns explain all, everything is as little as can be, far from where a search starts.
    """
    low, high, start = np.full(8, -18.0), np.full(8, 4.0), np.full(8, -7.0)
    for _ in range(4):
        rows = drifting(rng, 300)
        if is_explained:
            rows = replace(rows, torque=np.sum(rows.columns, axis=1))
        data = rows_of(rows)
        found = _settled(_Point(data, start), low, high)

        def cost(x, data=data):
            point = _Point(data, x)
            return point.cost, point.slope

        for first in (start, found.x):
            other = minimize(
                cost, first, jac=True, method='L-BFGS-B', bounds=list(zip(low, high, strict=True))
            )
            assert found.cost < other.fun + 1e-6


def rows_of(rows):
    """As the search has them, of columns of unit prior."""
    return _LevelRows(rows.columns, rows.torque, rows.observed, rows.gap)


@pytest.mark.parametrize('unit', [1e-3, 0.112984829, 1e3, 0.7])
def test_torques_that_were_written_in_another_unit_have_the_same_level(rng, unit):
    """They are rounded otherwise, in the last digit; fifteen passes made 1e-5 of it, and more."""
    for _ in range(3):
        rows, drift = drifting(rng, 300), np.array([0.3, 0.3, 3.0, 3.0])
        other = replace(rows, torque=rows.torque / unit * unit)
        found = [level_of(r, np.full(6, 2.0), 3.0, drift) for r in (rows, other)]
        np.testing.assert_allclose(found[1], found[0], rtol=1e-7, atol=0.0)


def test_steps_of_less_than_a_last_digit_end_the_search(rng, monkeypatch):
    """They have no change of slopes to tell a curvature by: nothing by nothing."""
    rows, drift = drifting(rng, 300), np.array([0.3, 0.3, 3.0, 3.0])
    settled = level_of(rows, np.full(6, 2.0), 3.0, drift)
    monkeypatch.setattr('spacerobot_ros.estimation.balance.reml._LEVEL', 0.0)
    found = level_of(rows, np.full(6, 2.0), 3.0, drift)
    np.testing.assert_allclose(found, settled, rtol=1e-7, atol=0.0)


def test_a_level_of_what_is_not_observed_is_none(rng):
    """A gain that drifts, of a joint that needs next to no torque: any would do."""
    rows = drifting(rng, 300)
    rows = replace(rows, observed=rows.observed * [1.0, 1e-5, 1.0, 1.0])
    found = level_of(rows, np.full(6, 2.0), 3.0, np.array([0.3, 0.3, 3.0, 3.0]))
    assert np.sqrt(found[5]) < 1e-3
