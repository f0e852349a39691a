"""Plots: small, titled with units, true to the peaks of the data."""

from __future__ import annotations

import re

import numpy as np
import pytest

from spacerobot_ros.display import Curve, Panel
from spacerobot_ros.report.plots import MAX_POINTS, plot, thinned


def test_thinning_keeps_every_peak_and_both_ends(rng):
    t = np.arange(100_000.0)
    y = rng.standard_normal(len(t))
    y[[777, 54_321]] = 50.0, -60.0
    kept_t, kept_y = thinned(t, y)
    assert len(kept_t) <= MAX_POINTS
    assert np.all(np.diff(kept_t) > 0)
    assert (kept_t[0], kept_t[-1]) == (t[0], t[-1])
    assert (kept_y.max(), kept_y.min()) == (50.0, -60.0)
    np.testing.assert_array_equal(kept_y, y[kept_t.astype(int)])


def test_thinning_leaves_short_curves_alone_and_survives_gaps():
    t = np.arange(10.0)
    assert thinned(t, t)[0] is t
    y = np.full(10_000, np.nan)
    y[5000] = 1.0
    assert 1.0 in thinned(np.arange(10_000.0), y)[1]


def test_title_unit_and_legend_are_text():
    t = np.linspace(0.0, 1.0, 50)
    svg = plot([Panel('Joint error', 'deg', [Curve('no AAM', t, t), Curve('AAM', t, t**2)])])
    for text in ('Joint error', '[deg]', 'no AAM', 'AAM', 'time [s]'):
        assert f'>{text}</text>' in svg
    assert svg.startswith('<svg role="img" aria-label="Joint error"')
    assert 'viewBox' in svg[:300]
    assert not re.search(r'<svg[^>]* width=', svg)
    assert 'date' not in svg.lower()


def test_a_long_run_stays_small():
    t = np.linspace(0.0, 100.0, 200_000)
    curves = [Curve(str(i), t, np.sin(t + i), half_band=0.1 + 0 * t) for i in range(3)]
    assert len(plot([Panel('x', '1', curves)])) < 400_000


@pytest.mark.parametrize('y', [np.zeros(5), np.full(5, np.nan), np.array([0, 1, np.nan, -1, 0.5])])
@pytest.mark.parametrize('log', [False, True])
def test_zeros_gaps_and_signs_are_drawn_without_a_warning(y, log):
    t = np.arange(5.0)
    plot([Panel('x', '1', [Curve('a', t, y, half_band=np.ones(5))], log=log)])


def test_two_calls_give_the_same_bytes_and_other_data_others():
    t = np.arange(5.0)
    first, again = (plot([Panel('x', '1', [Curve('a', t, t)])]) for _ in range(2))
    assert first == again
    assert first != plot([Panel('x', '1', [Curve('a', t, t + t**2)])])
