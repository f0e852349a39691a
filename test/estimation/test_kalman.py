"""The scalar-update filter against one dense Gaussian over the whole record."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.estimation.filters.kalman import StateSpace, correlate, gains_of, whiten

N, D, ERRORS, DRIVEN, WIDTH, STEP = 6, 7, 3, 1, 2, 0.1
MOVED = D - ERRORS


@pytest.fixture
def model(rng: np.random.Generator) -> StateSpace:
    """A small time-varying system whose rows measure single states and sums of them.

    Its errors of samples stay, go on as others, and are drawn anew.
    """
    first = np.concatenate([[0], np.cumsum(rng.integers(1, 4, size=N))])
    rows = int(first[-1])
    half = rng.normal(size=(N - 1, MOVED, 2))
    handed = np.array([[0, 1, 2], [1, -1, 2], [-1, -1, -1], [1, -1, 0], [0, 2, -1]])
    return StateSpace(
        durations=np.full(N - 1, STEP),
        transitions=np.eye(MOVED, D) + 0.3 * rng.normal(size=(N - 1, MOVED, D)),
        noise=half @ np.swapaxes(half, 1, 2),
        handed=handed,
        fresh_variance=np.where(handed < 0, rng.uniform(0.5, 2.0, size=handed.shape), 0.0),
        driven=DRIVEN,
        first_row=first,
        row_state=np.arange(rows) % (D + 2),
        row_matrix=rng.normal(size=(2, D)),
        row_variance=rng.uniform(0.5, 2.0, size=rows),
    )


@pytest.fixture
def start(rng: np.random.Generator) -> np.ndarray:
    return np.diag(rng.uniform(0.5, 2.0, size=D))


def rows_of(model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Time of every row, and its h."""
    time = np.repeat(np.arange(N), np.diff(model.first_row))
    return time, np.vstack([np.eye(D), model.row_matrix])[model.row_state]


def steps_of(model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of all states, (N-1, D, D)."""
    before, along = np.zeros((N - 1, D, D)), np.tile(np.eye(D), (N - 1, 1, 1))
    before[:, :MOVED, :MOVED] = np.eye(MOVED)
    for k, e in np.argwhere(model.handed >= 0):
        before[k, MOVED + e, MOVED + model.handed[k, e]] = 1.0
    along[:, :MOVED] = model.transitions
    fresh = np.zeros((N - 1, D, D))
    fresh[:, range(MOVED, D), range(MOVED, D)] = model.fresh_variance
    noise = along @ fresh @ np.swapaxes(along, 1, 2)
    noise[:, :MOVED, :MOVED] += model.noise
    return along @ before, noise


def dense(model: StateSpace, start: np.ndarray) -> np.ndarray:
    """Covariance of all measurements from the definition: every state a sum of sources."""
    transitions, noise = steps_of(model)
    spread = [start, *noise]
    maps = [np.hstack([np.eye(D), np.zeros((D, D * (N - 1)))])]
    for k, f in enumerate(transitions):
        own = np.zeros((D, D * N))
        own[:, D * (k + 1) : D * (k + 2)] = np.eye(D)
        maps.append(f @ maps[-1] + own)
    sources = np.zeros((D * N, D * N))
    for k, block in enumerate(spread):
        sources[D * k : D * (k + 1), D * k : D * (k + 1)] = block
    time, h = rows_of(model)
    design = np.stack([h[r] @ maps[k] for r, k in enumerate(time)])
    return design @ sources @ design.T + np.diag(model.row_variance)


def whitened(
    model: StateSpace, start: np.ndarray, measured: np.ndarray, rates: np.ndarray
) -> np.ndarray:
    mean = np.zeros((D, measured.shape[1]))
    return whiten(model, gains_of(model, start), mean, rates, np.zeros((0, 0)), measured)


def test_whitened_innovations_are_a_dense_gaussian(model: StateSpace, start: np.ndarray) -> None:
    rows = len(model.row_state)
    columns = whitened(model, start, np.eye(rows), np.zeros((N, WIDTH, rows)))
    covariance = dense(model, start)
    # W^T W = Sigma^-1 and the innovations' variances multiply to det Sigma
    np.testing.assert_allclose(
        columns.T @ columns, np.linalg.inv(covariance), rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(
        2.0 * np.sum(np.log(gains_of(model, start).std)),
        np.linalg.slogdet(covariance)[1],
        rtol=1e-10,
        atol=1e-10,  # rounding of a dozen products
    )


def test_what_drives_a_column_is_what_it_does_to_the_rows(
    model: StateSpace, start: np.ndarray, rng: np.random.Generator
) -> None:
    rates = rng.normal(size=(N, WIDTH, 2))
    driven = whitened(model, start, np.zeros((len(model.row_state), 2)), rates)
    state, states = np.zeros((D, 2)), [np.zeros((D, 2))]
    part = slice(DRIVEN, DRIVEN + WIDTH)
    for k, f in enumerate(steps_of(model)[0]):
        state[part] += 0.5 * STEP * rates[k]
        state = f @ state
        state[part] += 0.5 * STEP * rates[k + 1]
        states.append(state.copy())
    time, h = rows_of(model)
    change = np.stack([h[r] @ states[k] for r, k in enumerate(time)])
    still = np.zeros((N, WIDTH, 2))
    np.testing.assert_allclose(
        driven, -whitened(model, start, change, still), rtol=1e-9, atol=1e-11
    )


def test_jumps_move_the_first_column_alone(
    model: StateSpace, start: np.ndarray, rng: np.random.Generator
) -> None:
    jumps = rng.normal(size=(N - 1, 3))
    measured, rates = np.zeros((len(model.row_state), 2)), np.zeros((N, WIDTH, 2))
    found = whiten(model, gains_of(model, start), np.zeros((D, 2)), rates, jumps, measured)
    state, states = np.zeros(D), [np.zeros(D)]
    for f, jump in zip(steps_of(model)[0], jumps, strict=True):
        state = f @ state
        state[:3] += jump
        states.append(state.copy())
    time, h = rows_of(model)
    change = np.array([h[r] @ states[k] for r, k in enumerate(time)])[:, None]
    other = whitened(model, start, change, rates[..., :1])
    np.testing.assert_allclose(found[:, 0], -other[:, 0], rtol=1e-9, atol=1e-11)
    assert not found[:, 1].any()


def test_correlation_is_the_transpose(
    model: StateSpace, start: np.ndarray, rng: np.random.Generator
) -> None:
    rows = len(model.row_state)
    rates, weights = rng.normal(size=(N, WIDTH, 1)), rng.normal(size=rows)
    forward = whitened(model, start, np.zeros((rows, 1)), rates)[:, 0]
    backward = correlate(model, gains_of(model, start), weights, WIDTH)
    np.testing.assert_allclose(
        np.sum(backward * rates[..., 0]), weights @ forward, rtol=1e-10, atol=1e-12
    )
