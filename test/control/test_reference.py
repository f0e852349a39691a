"""Motions: boundary conditions, derivatives by finite differences, refusals."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spacerobot_ros.control.joint_reference import (
    Blend,
    Fourier,
    Hold,
    PointToPoint,
    Setpoint,
    build_reference,
    rest,
)
from spacerobot_ros.control.waypoints import Waypoints
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.motion_settings import ReferenceSettings

START = np.array([0.3, -0.2, 0.1])


def fourier(rng, **options):
    return Fourier(rng.normal(size=(3, 4)), rng.normal(size=(3, 4)), 7.0, START, **options)


def sampled(rng, kinds):
    times = np.array([0.5, 1.5, 3.0, 4.0])
    return Waypoints(times, *rng.normal(size=(kinds, 4, 3)), start=rest(START))


@pytest.fixture(params=['fourier', 'set_point', 'cubic', 'quintic', 'spline', 'blend'])
def motion(request, rng):
    if request.param == 'fourier':
        return fourier(rng)
    if request.param == 'set_point':
        return PointToPoint(START, rng.normal(size=3), 5.0)
    if request.param == 'blend':
        return Blend(fourier(rng), 1.0, Setpoint(*rng.normal(size=(3, 3))), 3.0)
    return sampled(rng, {'spline': 1, 'cubic': 2, 'quintic': 3}[request.param])


def test_rates_and_accelerations_are_derivatives(motion):
    h = 1e-5
    for t in np.linspace(1.05, 3.9, 23):
        before, here, after = motion.at(t - h), motion.at(t), motion.at(t + h)
        # central differences: h^2 q''' / 6, and round-off eps / h
        assert_allclose((after.q - before.q) / (2 * h), here.qd, rtol=1e-7, atol=1e-7)
        assert_allclose((after.qd - before.qd) / (2 * h), here.qdd, rtol=1e-6, atol=1e-6)


def test_fourier_is_at_rest_at_both_ends_and_the_paper_s_series_between(rng):
    a, b = rng.normal(size=(2, 3, 4))
    motion = Fourier(a, b, 7.0, START)
    for t in (1e-9, 7.0 - 1e-9):
        point = motion.at(t)
        assert_allclose(point.q, START, atol=1e-12)
        assert_allclose(point.qd, 0.0, atol=1e-7)  # 1e-9 s off the end
        assert_allclose(point.qdd, 0.0, atol=1e-6)
    # what is left beside the series of eq. (33) is a polynomial of degree five
    w = 2 * np.pi / 7.0
    times = np.linspace(0.01, 6.99, 12)
    series = [
        sum(
            a[:, k] / (w * (k + 1)) * np.sin(w * (k + 1) * t)
            - b[:, k] / (w * (k + 1)) * np.cos(w * (k + 1) * t)
            for k in range(4)
        )
        for t in times
    ]
    rest_of_it = np.array([motion.at(t).q for t in times]) - series
    fit = np.polynomial.polynomial.polyfit(times, rest_of_it, 5)
    assert_allclose(np.polynomial.polynomial.polyval(times, fit).T, rest_of_it, atol=1e-11)


def test_holds_before_and_after(rng):
    motion = PointToPoint(START, np.ones(3), 2.0)
    for t, q in ((-1.0, START), (2.0, np.ones(3)), (99.0, np.ones(3))):
        point = motion.at(t)
        assert np.array_equal(point.q, q)
        assert not point.qd.any()
        assert not point.qdd.any()


def test_repeats_where_asked(rng):
    seed = rng.integers(1000)
    once = fourier(np.random.default_rng(seed))
    again = fourier(np.random.default_rng(seed), repeat=True)
    assert_allclose(again.at(7.0 + 2.5).q, once.at(2.5).q, rtol=1e-12)
    assert again.duration == np.inf
    assert np.array_equal(once.at(9.5).q, START)


def test_sampled_passes_through_its_points_from_the_start(rng):
    values = rng.normal(size=(3, 4, 3))
    motion = Waypoints(np.array([0.5, 1.5, 3.0, 4.0]), *values, start=rest(START))
    assert_allclose(motion.at(0.0).q, START, atol=1e-14)
    for i, t in enumerate((0.5, 1.5, 3.0)):
        for got, want in zip(motion.at(t), values[:, i], strict=True):
            assert_allclose(got, want, atol=1e-12)
    assert np.array_equal(motion.at(4.0).q, values[0, 3])


def test_one_point_is_a_hold():
    motion = Waypoints(np.array([0.0]), np.ones((1, 3)))
    assert np.array_equal(motion.at(0.0).q, np.ones(3))


@pytest.mark.parametrize(
    ('times', 'q', 'message'),
    [
        ([], np.zeros((0, 3)), 'no points'),
        ([0.0, 0.0], np.zeros((2, 3)), 'increase'),
        ([-1.0, 1.0], np.zeros((2, 3)), 'zero or later'),
        ([0.0, 1.0], np.full((2, 3), np.nan), 'not finite'),
        ([0.0, 1.0], np.zeros((3, 3)), 'every point'),
    ],
)
def test_sampled_refuses(times, q, message):
    with pytest.raises(ConfigurationError, match=message):
        Waypoints(np.array(times), q)


def test_blend_starts_where_told_and_ends_on_the_motion(rng):
    inner = fourier(rng)
    start = Setpoint(*rng.normal(size=(3, 3)))
    motion = Blend(inner, 1.0, start, 2.0)
    for got, want in zip(motion.at(1.0), start, strict=True):
        assert_allclose(got, want, atol=1e-13)
    assert np.array_equal(motion.at(3.0).q, inner.at(3.0).q)


def test_settings_make_the_reference():
    assert isinstance(build_reference(ReferenceSettings(), START), Hold)
    settings = ReferenceSettings(kind='fourier', harmonics=1, sine=(1.0,) * 3, cosine=(0.0,) * 3)
    assert isinstance(build_reference(settings, START), Fourier)
    for wrong, place in (
        (dataclasses.replace(settings, sine=(1.0,)), 'reference.sine: expected 3 numbers'),
        (ReferenceSettings(kind='set_point', set_point=(1.0,)), 'reference.set_point'),
    ):
        with pytest.raises(ConfigurationError, match=place):
            build_reference(wrong, START)
