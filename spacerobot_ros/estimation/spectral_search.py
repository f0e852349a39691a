"""Frequencies that the data themselves propose for effects that go as sin(p u(t) + phase).

A torque ripple goes with the joint's angle, an imbalance with time: p is a harmonic or a
frequency, and no grid of guesses is fine enough. The correlation of the innovations with such a
force at every p is one transform of what `Innovations.force_correlation` gives, so all p are
looked at.
"""

from __future__ import annotations

import cmath

import numpy as np
import scipy

from ..dynamics.compiling import compiled
from ..effects.effect import Effect
from ..effects.motion import Motion
from ..effects.parameter import Parameter
from ..types import Array

_PEAKS = 3
_OVERSAMPLING = 2.0
_FEW = (0.25, 0.5, 1.0, 1.5)
"""Rounds along the record that have no peak; a fit finds its way from one to the next."""
_NEIGHBOURHOOD = 101  # values of p over which the background is judged
_MOST = 4000
_CHUNK = 256  # turns after which rounding is started afresh


def searched(effect: type[Effect]) -> Parameter | None:
    """The parameter that multiplies the effect's argument; None where it has no such argument."""
    if not effect.acts('argument'):
        return None
    return next(p for p in effect.parameters if p.role == 'search')


def propose(
    effect: type[Effect], where: str | None, motion: Motion, wanted: Array
) -> tuple[tuple[float, ...], int]:
    """Values of p that stand out, and how many were looked at.

    Args:
        effect: An effect with an argument.
        where: Its place.
        motion: The reference motion.
        wanted: (N, 6 + n) from `Innovations.force_correlation`.
    """
    parameter = searched(effect)
    argument = effect.argument(motion, where)
    if parameter is None or argument is None:
        return (), 0
    values = _values(parameter, argument)
    signals = _signals(effect, where, motion, wanted, parameter.name)
    power = _power(values, np.ascontiguousarray(argument), signals)
    background = scipy.ndimage.median_filter(power, _NEIGHBOURHOOD, mode='nearest')
    ratio = power / np.maximum(background, 1e-300)
    chosen: list[float] = []
    apart = 2.0 * _OVERSAMPLING * float(values[1] - values[0])
    for k in np.argsort(-ratio):
        if all(abs(values[k] - other) > apart for other in chosen):
            chosen.append(float(values[k]))
        if len(chosen) == _PEAKS:
            break
    few = (rounds * 2.0 * np.pi / max(float(np.ptp(argument)), 1e-6) for rounds in _FEW)
    slow = [p for p in few if min(parameter.guesses) <= p < values[0]]
    return (*chosen, *slow), len(values) + len(slow)


def _values(parameter: Parameter, argument: Array) -> Array:
    """Values of p as close as the argument's range can resolve, up to Nyquist's limit."""
    span = float(np.ptp(argument))
    step = 2.0 * np.pi / max(span, 1e-6) / _OVERSAMPLING
    rate = float(np.median(np.abs(np.diff(argument))))
    high = min(max(parameter.guesses), np.pi / rate if rate > 0.0 else np.inf)
    # less than two rounds along the record are no peak beside a bias and a spring
    low = max(min(parameter.guesses), min(2.0 * _OVERSAMPLING * step, 0.5 * high))
    count = int(np.clip((high - low) / step, 2, _MOST)) + 1
    return np.linspace(low, high, count)


@compiled
def _power(values: Array, argument: Array, signals: Array) -> Array:
    """(P,) sum of |sum_t signals e^(i p u)|^2 at even steps of p, turned from each to the next."""
    power = np.zeros(len(values))
    count, step = len(argument), values[1] - values[0]
    turn, wave = np.empty(count, np.complex128), np.empty(count, np.complex128)
    for t in range(count):
        turn[t] = cmath.exp(1j * step * argument[t])
    for k in range(len(values)):
        if k % _CHUNK == 0:
            for t in range(count):
                wave[t] = cmath.exp(1j * values[k] * argument[t])
        for c in range(signals.shape[1]):
            total = 0.0j
            for t in range(len(wave)):
                total += wave[t] * signals[t, c]
            power[k] += total.real**2 + total.imag**2
        for t in range(len(wave)):
            wave[t] *= turn[t]
    return power


def _signals(
    effect: type[Effect], where: str | None, motion: Motion, wanted: Array, name: str
) -> Array:
    """(N, 2) correlation with the force that the effect has at p = 0, for two phases."""
    (amplitude,) = [p.name for p in effect.parameters if p.role == 'linear'][:1]
    (phase,) = [p.name for p in effect.parameters if p.role == 'phase']
    hidden = np.zeros((len(motion), effect.hidden))
    still = {**effect.nominal(), amplitude: 1.0, name: 0.0}
    forces = [
        effect(name='', where=where, values={**still, phase: turn}).force(motion, hidden)
        for turn in (0.0, 0.5 * np.pi)
    ]
    return np.stack([np.sum(wanted * force, axis=1) for force in forces], axis=1)
