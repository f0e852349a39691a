"""Plots: small, true to the peaks of the data, over one abscissa."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from spacerobot_ros.display import Curve, Panel
from spacerobot_ros.report.plots import MOST_POINTS, inline_json, panels_of, thinned


def numbers(text):
    return np.frombuffer(base64.b64decode(text), '<f4')


def test_thinning_keeps_every_peak_and_both_ends(rng):
    t = np.arange(100_000.0)
    y = rng.standard_normal(len(t))
    y[[777, 54_321]] = 50.0, -60.0
    kept_t, kept_y = thinned(t, y, 1500)
    assert len(kept_t) <= 1500
    assert np.all(np.diff(kept_t) > 0)
    assert (kept_t[0], kept_t[-1]) == (t[0], t[-1])
    assert (kept_y.max(), kept_y.min()) == (50.0, -60.0)
    np.testing.assert_array_equal(kept_y, y[kept_t.astype(int)])


def test_thinning_leaves_short_curves_alone_and_survives_gaps():
    t = np.arange(10.0)
    assert thinned(t, t, 10)[0] is t
    y = np.full(10_000, np.nan)
    y[5000] = 1.0
    assert 1.0 in thinned(np.arange(10_000.0), y, 1500)[1]


def test_curves_share_their_times_and_keep_their_peaks():
    time = np.linspace(0.0, 1.0, 10_001)
    spike = np.zeros(10_001)
    spike[5003] = 7.0
    curves = [Curve('', time, spike), Curve('', time[:2], spike[:2])]
    (panel,) = panels_of([Panel('a', 'm', curves)])
    first, second = (numbers(c['y']) for c in panel['curves'])
    assert first.max() == 7.0
    assert len(first) == len(second) <= MOST_POINTS
    assert np.isnan(second[-1])


def test_panels_span_the_same_abscissa_and_empty_ones_are_left_out():
    long, short, none = np.arange(10.0), np.arange(3.0, 5.0), np.zeros(0)
    shown = [[Curve('', t, t) for t in of] for of in ((long,), (short, none), ())]
    first, second = panels_of([Panel('a', 'm', curves) for curves in shown])
    assert numbers(first['x'])[[0, -1]].tolist() == numbers(second['x'])[[0, -1]].tolist()
    np.testing.assert_array_equal(numbers(second['curves'][0]['y']), [np.nan, 3, 4, np.nan])
    assert np.isnan(numbers(second['curves'][1]['y'])).all()
    assert numbers(panels_of([Panel('a', 'm', [Curve('', none, none)])])[0]['x']).size == 0


def test_a_long_run_stays_small():
    t = np.linspace(0.0, 100.0, 200_000)
    curves = [Curve(str(i), t, np.sin(t + i), half_band=0.1 + 0 * t) for i in range(3)]
    assert len(inline_json(panels_of([Panel('x', '1', curves)]))) < 100_000


@pytest.mark.parametrize('y', [np.zeros(5), np.full(5, np.nan), np.array([0, 1, np.nan, -1, 0.5])])
def test_only_magnitudes_above_zero_are_on_a_log_scale(y):
    (panel,) = panels_of([Panel('x', '1', [Curve('a', np.arange(5.0), y, np.ones(5))], log=True)])
    (curve,) = panel['curves']
    shown = {key: numbers(curve[key]) for key in ('low', 'y', 'high')}
    np.testing.assert_array_equal(shown['y'], np.where(y == 0.0, np.nan, np.abs(y)))
    np.testing.assert_array_equal(shown['high'], np.where(y > -1.0, y + 1.0, np.nan))
    assert np.isnan(shown['low']).all()
