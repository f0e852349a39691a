"""The scalar-update filter against one dense Gaussian over the whole record."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.estimation.filter_recursions import adjoint_pass, covariance_pass, mean_pass

N, M, JOINTS, STEP = 6, 2, 1, 0.1
D = 2 * M + 2 * JOINTS


@pytest.fixture
def system(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A small time-varying system with a new effort sample at every other step."""
    transitions = np.eye(D) + 0.3 * rng.normal(size=(N - 1, D, D))
    transitions[:, 2 * M :] = np.eye(D)[2 * M :]
    per_time = rng.integers(1, 4, size=N)
    first = np.concatenate([[0], np.cumsum(per_time)])
    rows = int(first[-1])
    return {
        'transitions': transitions,
        'fresh': np.array([2, 0, 1, 0, 1]),
        'effort_variance': np.full((N - 1, JOINTS), 0.7),
        'first': first,
        'state': rng.integers(0, 2 * M, size=rows),
        'variance': rng.uniform(0.5, 2.0, size=rows),
        'start': np.diag(rng.uniform(0.5, 2.0, size=D)),
        'extra': np.zeros((N - 1, D)),
    }


def dense(system: dict[str, np.ndarray]) -> np.ndarray:
    """Covariance of all measurements from the definition: every state a sum of sources."""
    # sources: initial state, then one effort sample a column as it enters
    samples = np.eye(D)
    spread = [system['start']]
    maps = [samples]
    sources = D
    current = samples
    for k in range(N - 1):
        fresh = system['fresh'][k]
        shifted = np.zeros((D, sources + 2 * JOINTS))
        shifted[:, :sources] = current
        if fresh == 1:
            shifted[D - 2 : D - 1] = shifted[D - 1 : D]
        if fresh == 2:
            shifted[D - 2 : D - 1] = 0.0
            shifted[D - 2, sources] = 1.0
        if fresh:
            shifted[D - 1] = 0.0
            shifted[D - 1, sources + 1] = 1.0
        spread.append(np.eye(2 * JOINTS) * system['effort_variance'][k, 0])
        sources += 2 * JOINTS
        current = system['transitions'][k] @ shifted
        maps.append(current)
    covariance = np.zeros((sources, sources))
    start = 0
    for block in spread:
        size = len(block)
        covariance[start : start + size, start : start + size] = block
        start += size
    rows = []
    for k in range(N):
        full = np.zeros((D, sources))
        full[:, : maps[k].shape[1]] = maps[k]
        rows += list(full[system['state'][system['first'][k] : system['first'][k + 1]]])
    design = np.array(rows)
    return design @ covariance @ design.T + np.diag(system['variance'])


def gains(system: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    found = covariance_pass(
        system['transitions'],
        system['fresh'],
        system['effort_variance'],
        system['first'],
        system['state'],
        system['variance'],
        system['start'].copy(),
        system['extra'],
    )
    return found[0], found[1]


def whiten(
    system: dict[str, np.ndarray], measured: np.ndarray, accelerations: np.ndarray
) -> np.ndarray:
    gain, stds = gains(system)
    return mean_pass(
        np.zeros((D, measured.shape[1])),
        (0, N),
        np.full(N - 1, STEP),
        system['transitions'],
        system['fresh'],
        accelerations,
        np.zeros((0, 0)),
        system['first'],
        system['state'],
        gain,
        stds,
        measured,
        JOINTS,
    )


def test_whitened_innovations_are_a_dense_gaussian(
    system: dict[str, np.ndarray], rng: np.random.Generator
) -> None:
    rows = len(system['state'])
    columns = whiten(system, np.eye(rows), np.zeros((N, M, rows)))
    covariance = dense(system)
    # W^T W = Sigma^-1 and the innovations' variances multiply to det Sigma
    np.testing.assert_allclose(
        columns.T @ columns, np.linalg.inv(covariance), rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(
        2.0 * np.sum(np.log(gains(system)[1])),
        np.linalg.slogdet(covariance)[1],
        rtol=1e-10,
        atol=1e-10,  # rounding of a dozen products
    )


def test_columns_are_linear_in_what_drives_them(
    system: dict[str, np.ndarray], rng: np.random.Generator
) -> None:
    rows = len(system['state'])
    drive = rng.normal(size=(N, M, 2))
    zero = np.zeros((rows, 1))
    both = whiten(system, zero, drive.sum(axis=2, keepdims=True))
    each = whiten(system, np.zeros((rows, 2)), drive)
    np.testing.assert_allclose(both[:, 0], each.sum(axis=1), rtol=1e-10, atol=1e-12)


def test_adjoint_is_the_transpose(system: dict[str, np.ndarray], rng: np.random.Generator) -> None:
    rows = len(system['state'])
    drive, weights = rng.normal(size=(N, M, 1)), rng.normal(size=rows)
    forward = whiten(system, np.zeros((rows, 1)), drive)[:, 0]
    gain, stds = gains(system)
    adjoint = adjoint_pass(
        np.full(N - 1, STEP),
        system['transitions'],
        system['fresh'],
        system['first'],
        system['state'],
        gain,
        stds,
        weights,
        M,
        JOINTS,
    )
    np.testing.assert_allclose(
        np.sum(adjoint * drive[..., 0]), weights @ forward, rtol=1e-10, atol=1e-12
    )
