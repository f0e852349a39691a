"""What the wheel-momentum identification paper prints, and our own derivation's figures.

The paper prints neither its joint axes nor its condition numbers nor its noise levels nor its
gains; `REFERENCE` holds what an independent prototype found for the readings that fit
(docs/reproduction.md).
"""

from __future__ import annotations

from typing import Any

TARGET_MOMENTUM = (42.0, 49.0, 41.0)  # N m s, section IV
SAMPLES, SAMPLE_PERIOD = 1000, 0.02  # "N = 1000" of 20 s; the printed 50 ms does not fit
UNKNOWNS = 22  # rows of Table III: 3 wheel momenta and k = 19
TABLE_SCALE = 0.1  # of our noise, where least squares makes errors as large as those in Table III
TRACKING_ERROR_DEG, TRACKING_ERROR_M = 8.0, 0.9  # Figs 6 and 7, without knowledge of the wheels


TABLE_III: dict[str, tuple[Any, ...]] = {
    'label': (
        *(f'x{i}' for i in range(1, 11)),
        *('x12', 'x13', 'x14', 'x15', 'x16', 'x17', 'x18', 'x18', 'x19', 'x20', 'x21', 'x21'),
    ),
    'exact': (
        *(6e-11, -4e-10, -2e-10, 6e-11, 1e-10, 6e-11, 4e-11, 6e-11, 6e-11, 6e-11, 4e-11),
        *(3e-11, 7e-11, 7e-11, 1e-10, -9e-12, 6e-11, 3e-10, 6e-11, 7e-11, 6e-11, 6e-11),
    ),
    'noisy': (
        *(0.16, -0.96, -0.75, 0.17, 0.12, 0.16, 0.10, 0.16, 0.17, 0.17, 0.15),
        *(0.14, 0.14, 0.17, 0.17, 0.09, 0.13, 0.46, 0.17, 0.17, 0.16, 0.16),
    ),
}
"""Rows of Table III: labels as printed (two indices occur twice, one is missing), relative errors
without and with noise [%]."""
LARGEST_EXACT: float = max(map(abs, TABLE_III['exact']))


# (axes, structure) -> size of the minimal set; condition of A by start, raw and with unit columns
CONDITION_REFERENCE: dict[tuple[str, str], dict[str, Any]] = {
    case: {'k': k, 'moving': moving, 'wheels': wheels, 'spin_up': spin_up}
    for case, k, moving, wheels, spin_up in (
        (('xyy', 'symmetric'), 19, (928, 306), (939, 266), (577, 160)),
        (('zyx', 'symmetric'), 19, (801, 248), (1310, 334), (663, 167)),
        (('zyy', 'symmetric'), 24, (1602, 782), (1010, 317), (504, 154)),
        (('xyy', 'generic'), 45, (1.6e4, 6.2e3), (6.4e3, 2.2e3), (2.4e3, 802)),
        (('zyx', 'generic'), 45, (7.6e3, 2.7e3), (7.6e3, 2.3e3), (1.6e3, 494)),
    )
}

TRACKING_ERRORS = ('max_joint_error_deg', 'max_end_effector_error_m')

# (axes, plant, law, bandwidth) -> largest errors, of the end effector in the base frame
TRACKING_REFERENCE = {
    (axes, plant, law, bandwidth): dict(zip(TRACKING_ERRORS, errors, strict=True))
    for axes, plant, law, *pairs in (
        ('xyy', 'correct', 'no_aam', (16.2, 0.63), (7.5, 0.32), (2.22, 0.104), (0.59, 0.029)),
        ('xyy', 'correct', 'paper', (19.4, 0.86), (9.4, 0.44), (2.92, 0.141), (0.79, 0.044)),
        ('xyy', 'paper', 'no_aam', (8.6, 0.47), (3.7, 0.18), (1.19, 0.062), (0.37, 0.022)),
        ('zyx', 'correct', 'no_aam', (8.2, 0.53), (4.5, 0.23), (2.10, 0.083), (0.98, 0.033)),
        ('zyx', 'correct', 'paper', (13.2, 0.91), (7.2, 0.41), (3.08, 0.127), (1.25, 0.046)),
        ('zyx', 'paper', 'no_aam', (13.4, 1.00), (7.9, 0.49), (3.34, 0.128), (1.17, 0.028)),
    )
    for bandwidth, errors in zip((0.3, 0.5, 1.0, 2.0), pairs, strict=True)
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
