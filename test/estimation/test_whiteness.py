"""The fit test: silent on white noise, and on nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.estimation.inference.whiteness import channel_fit, spectral_lines

COUNT, RATE = 4000, 100.0
TIMES = np.arange(COUNT) / RATE


def p_of(values: np.ndarray) -> float:
    return channel_fit('gyro', 0, values, TIMES).p_value


def test_white_noise_passes_at_the_stated_rate(rng: np.random.Generator) -> None:
    p = np.array([p_of(rng.normal(size=COUNT)) for _ in range(400)])
    # Bonferroni is cautious; 400 draws scatter by 0.011 about a rate of 0.05
    assert np.mean(p < 0.05) < 0.05 + 0.035
    assert np.mean(p < 0.5) > 0.1


def test_a_level_that_is_stated_wrong_is_no_misfit(rng: np.random.Generator) -> None:
    assert p_of(1.3 * rng.normal(size=COUNT)) > 1e-3


@pytest.mark.parametrize('frequency', [0.05, 0.4, 7.3, 31.0, 49.9])
def test_a_line_at_any_frequency_is_seen(rng: np.random.Generator, frequency: float) -> None:
    values = rng.normal(size=COUNT) + 0.25 * np.sin(2.0 * np.pi * frequency * TIMES + 0.7)
    found = channel_fit('gyro', 0, values, TIMES)
    assert found.p_value < 1e-6
    if frequency > 1.0:
        np.testing.assert_allclose(
            spectral_lines((found,)), [2.0 * np.pi * frequency], rtol=0.01, atol=0.0
        )


def test_a_slow_drift_is_seen(rng: np.random.Generator) -> None:
    assert p_of(rng.normal(size=COUNT) + 0.3 * np.linspace(-1.0, 1.0, COUNT)) < 1e-6
