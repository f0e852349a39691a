"""Time of a control cycle: measurement and target in, torques out."""

from __future__ import annotations

import time

import numpy as np

from ..control.adaptive.controller import AdaptiveController
from ..control.adaptive.settings import AdaptiveSettings
from ..control.adaptive.types import Measured
from .adaptive_scenario import harmonic, minisat

TIMED = (
    ('passivity', 'none'),
    ('adaptive_lyapunov', 'none'),
    ('adaptive_lyapunov', 'natural'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'project'),
    ('adaptive_lyapunov_paper', 'none'),
    ('adaptive_rls_paper', 'none'),
)
_PERIOD, _CYCLES, _BLOCKS = 0.05, 1000, 5


def cycle_time(law: str, consistency: str) -> float:
    """Time of a cycle [us]: of blocks of a thousand, the quickest block's median."""
    settings = AdaptiveSettings(law=law, physical_consistency=consistency)
    controller = AdaptiveController(minisat(), settings, _PERIOD)
    targets = [harmonic(k * _PERIOD) for k in range(_CYCLES)]
    states = [_on_target(k * _PERIOD) for k in range(_CYCLES)]
    medians = []
    for _ in range(1 + _BLOCKS):  # the first block compiles
        spans = []
        for state, target in zip(states, targets, strict=True):
            started = time.perf_counter_ns()
            controller.step(state, target)
            spans.append(time.perf_counter_ns() - started)
        medians.append(float(np.median(spans)))
    return min(medians[1:]) * 1e-3


def _on_target(t: float) -> Measured:
    """A state that lags the harmonic task by a hundredth of a second."""
    point = harmonic(t - 0.01)
    return Measured(point.q_WD_xyzw, point.omega_WD_D, point.q, point.qd, np.zeros(3))
