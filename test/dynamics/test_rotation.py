"""Rotations: group axioms, conventions pinned, full precision near the identity and near pi."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.attitudes import quaternion_rate

from spacerobot_ros.dynamics.rotation import (
    cross,
    cross_rows,
    rotation_matrix,
    skew,
)

ULP = 5e-15  # a few roundings of numbers of order one
numbers = st.floats(-10.0, 10.0, allow_nan=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@st.composite
def quaternions(draw):
    """Draw unit quaternions xyzw: anywhere, near the identity, near pi, and exactly either."""
    axis = draw(vectors.filter(lambda v: np.linalg.norm(v) > 1e-3))
    small = draw(st.sampled_from([0.0, 1e-16, 1e-12, 1e-8, 1e-4]))
    angle = draw(
        st.sampled_from([small, np.pi - small, -np.pi + small]) | st.floats(-np.pi, np.pi)
    )
    e = np.sin(angle / 2.0) * axis / np.linalg.norm(axis)
    return np.append(e, np.cos(angle / 2.0))


def product(a, b):
    """Hamilton product of quaternions xyzw."""
    return np.append(
        a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3]
    )


def test_order_is_xyzw_and_takes_base_to_inertial():
    # 90 deg about z takes x to y.
    q_xyzw = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    np.testing.assert_allclose(
        rotation_matrix(q_xyzw) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], rtol=0, atol=ULP
    )


@given(vectors, vectors)
def test_cross_and_skew(a, b):
    np.testing.assert_allclose(
        cross(a, b), np.cross(a, b), rtol=0, atol=1e-13
    )  # products up to 100
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), rtol=0, atol=1e-13)


@pytest.mark.parametrize('count', [1, 99, 100, 500])
def test_cross_products_of_few_rows_and_of_many(rng, count):
    a, b, one = rng.normal(size=(count, 6))[:, 3:], rng.normal(size=(count, 3)), rng.normal(size=3)
    for left, right in ((a, b), (one, b), (a, one)):
        np.testing.assert_allclose(
            cross_rows(left, right), np.cross(left, right), rtol=0, atol=1e-13
        )


@given(quaternions())
def test_rotation_matrix_is_a_rotation(q):
    R = rotation_matrix(q)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=ULP)
    assert np.linalg.det(R) > 0.0
    np.testing.assert_allclose(R, Rotation.from_quat(q).as_matrix(), rtol=0, atol=ULP)


@given(quaternions(), quaternions())
def test_product_maps_to_product(a, b):
    np.testing.assert_allclose(
        rotation_matrix(product(a, b)), rotation_matrix(a) @ rotation_matrix(b), rtol=0, atol=ULP
    )


@given(quaternions(), st.floats(0.1, 10.0))
def test_sign_and_length_do_not_matter(q, scale):
    np.testing.assert_allclose(rotation_matrix(-scale * q), rotation_matrix(q), rtol=0, atol=ULP)


@given(quaternions(), vectors)
def test_quaternion_rate_is_the_derivative_along_a_body_rate(q, omega):
    # Centred difference: 1e-5^2 |omega|^3 / 24 < 5e-9, roundings 1e-16 / 1e-5.
    dt = 1e-5

    def ahead(t):
        return product(q, Rotation.from_rotvec(omega * t).as_quat())

    np.testing.assert_allclose(
        quaternion_rate(q, omega), (ahead(dt / 2) - ahead(-dt / 2)) / dt, rtol=0, atol=1e-7
    )
    assert abs(q @ quaternion_rate(q, omega)) < 1e-13  # keeps the length
