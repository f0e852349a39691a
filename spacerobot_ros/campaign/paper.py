"""What the wheel-momentum identification paper prints, and our own derivation's figures.

The paper prints neither its joint axes nor its condition numbers nor its noise levels nor its
gains; `REFERENCE` holds what an independent prototype found for the readings that fit
(docs/reproduction.md).
"""

from __future__ import annotations

from typing import NamedTuple

TARGET_MOMENTUM = (42.0, 49.0, 41.0)  # N m s, section IV
SAMPLES, SAMPLE_PERIOD = 1000, 0.02  # "N = 1000" of 20 s; the printed 50 ms does not fit
UNKNOWNS = 22  # rows of Table III: 3 wheel momenta and k = 19
TRACKING_ERROR_DEG, TRACKING_ERROR_M = 8.0, 0.9  # Figs 6 and 7, without knowledge of the wheels


class TableRow(NamedTuple):
    """A row of Table III.

    Args:
        label: As printed (two indices occur twice, one is missing).
        exact: Relative error without noise [%].
        noisy: Relative error with noise [%].
    """

    label: str
    exact: float
    noisy: float


TABLE_III = (
    TableRow('x1', 6e-11, 0.16),
    TableRow('x2', -4e-10, -0.96),
    TableRow('x3', -2e-10, -0.75),
    TableRow('x4', 6e-11, 0.17),
    TableRow('x5', 1e-10, 0.12),
    TableRow('x6', 6e-11, 0.16),
    TableRow('x7', 4e-11, 0.10),
    TableRow('x8', 6e-11, 0.16),
    TableRow('x9', 6e-11, 0.17),
    TableRow('x10', 6e-11, 0.17),
    TableRow('x12', 4e-11, 0.15),
    TableRow('x13', 3e-11, 0.14),
    TableRow('x14', 7e-11, 0.14),
    TableRow('x15', 7e-11, 0.17),
    TableRow('x16', 1e-10, 0.17),
    TableRow('x17', -9e-12, 0.09),
    TableRow('x18', 6e-11, 0.13),
    TableRow('x18', 3e-10, 0.46),
    TableRow('x19', 6e-11, 0.17),
    TableRow('x20', 7e-11, 0.17),
    TableRow('x21', 6e-11, 0.16),
    TableRow('x21', 6e-11, 0.16),
)


class ConditionReference(NamedTuple):
    """Reference figures of one robot and minimal set.

    Args:
        k: Size of the minimal set.
        moving: Condition of A of (27), raw and with unit columns.
        wheels: Raw and unit, robot at rest and all wheels spinning.
        spin_up: Raw and unit, (31).
    """

    k: int
    moving: tuple[float, float]
    wheels: tuple[float, float]
    spin_up: tuple[float, float]


CONDITION_REFERENCE = {
    ('xyy', 'symmetric'): ConditionReference(19, (928, 306), (939, 266), (577, 160)),
    ('zyx', 'symmetric'): ConditionReference(19, (801, 248), (1310, 334), (663, 167)),
    ('zyy', 'symmetric'): ConditionReference(24, (1602, 782), (1010, 317), (504, 154)),
    ('xyy', 'generic'): ConditionReference(45, (1.6e4, 6.2e3), (6.4e3, 2.2e3), (2.4e3, 802)),
    ('zyx', 'generic'): ConditionReference(45, (7.6e3, 2.7e3), (7.6e3, 2.3e3), (1.6e3, 494)),
}

# (axes, plant, law, bandwidth) -> largest joint error [deg] and end-effector error [m], base frame
TRACKING_REFERENCE = {
    ('xyy', 'correct', 'no_aam', 0.3): (16.2, 0.63),
    ('xyy', 'correct', 'no_aam', 0.5): (7.5, 0.32),
    ('xyy', 'correct', 'no_aam', 1.0): (2.22, 0.104),
    ('xyy', 'correct', 'no_aam', 2.0): (0.59, 0.029),
    ('xyy', 'correct', 'paper', 0.3): (19.4, 0.86),
    ('xyy', 'correct', 'paper', 0.5): (9.4, 0.44),
    ('xyy', 'correct', 'paper', 1.0): (2.92, 0.141),
    ('xyy', 'correct', 'paper', 2.0): (0.79, 0.044),
    ('xyy', 'paper', 'no_aam', 0.3): (8.6, 0.47),
    ('xyy', 'paper', 'no_aam', 0.5): (3.7, 0.18),
    ('xyy', 'paper', 'no_aam', 1.0): (1.19, 0.062),
    ('xyy', 'paper', 'no_aam', 2.0): (0.37, 0.022),
    ('zyx', 'correct', 'no_aam', 0.3): (8.2, 0.53),
    ('zyx', 'correct', 'no_aam', 0.5): (4.5, 0.23),
    ('zyx', 'correct', 'no_aam', 1.0): (2.10, 0.083),
    ('zyx', 'correct', 'no_aam', 2.0): (0.98, 0.033),
    ('zyx', 'correct', 'paper', 0.3): (13.2, 0.91),
    ('zyx', 'correct', 'paper', 0.5): (7.2, 0.41),
    ('zyx', 'correct', 'paper', 1.0): (3.08, 0.127),
    ('zyx', 'correct', 'paper', 2.0): (1.25, 0.046),
    ('zyx', 'paper', 'no_aam', 0.3): (13.4, 1.00),
    ('zyx', 'paper', 'no_aam', 0.5): (7.9, 0.49),
    ('zyx', 'paper', 'no_aam', 1.0): (3.34, 0.128),
    ('zyx', 'paper', 'no_aam', 2.0): (1.17, 0.028),
}

# (axes, noise scale, method) -> RMSE / bound of AAM and of base parameters, |bias| / RMSE
ESTIMATOR_REFERENCE = {
    ('xyy', 1.0, 'paper'): (124.0, 165.0, 0.97),
    ('zyx', 1.0, 'paper'): (144.0, 188.0, 0.95),
    ('xyy', 0.1, 'paper'): (38.0, 24.0, 0.67),
    ('zyx', 0.1, 'paper'): (66.0, 71.0, 0.49),
    ('xyy', 1.0, 'ls'): (131.0, 174.0, 1.0),
    ('zyx', 1.0, 'ls'): (129.0, 168.0, 1.0),
    ('xyy', 0.1, 'ls'): (18.0, 22.0, 0.88),
    ('zyx', 0.1, 'ls'): (17.0, 21.0, 0.90),
    ('xyy', 1.0, 'ml'): (0.96, 0.98, 0.10),
    ('zyx', 1.0, 'ml'): (0.97, 1.06, 0.10),
    ('xyy', 0.1, 'ml'): (1.05, 1.10, 0.07),
    ('zyx', 0.1, 'ml'): (0.97, 1.06, 0.10),
}

# axes -> Cramer-Rao bound at noise scale 1: AAM, one an axis, and median base parameter [%]
BOUND_REFERENCE = {
    'xyy': ((0.141, 0.125, 0.146), 0.079),
    'zyx': ((0.133, 0.111, 0.112), 0.062),
}
