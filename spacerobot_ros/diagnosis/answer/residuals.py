"""Prediction errors in physical units: what the sensors said beyond what the model foresaw.

Beside the sensors' own channels, the torque on each joint and on the base (the rate at which
angular momentum seems to change) that would explain each half second.
"""

from __future__ import annotations

import numpy as np

from ...estimation.evidence import Gram
from ...estimation.prediction import Columns, Innovations
from ...estimation.time_base import CHANNELS
from ...estimation.whiteness import ChannelFit
from ...types import Array, IntArray
from .result import Residual, Series

_WINDOW = 0.5  # s
_MEMORY = 4.0  # s; after which the filter has forgotten a torque
_START = 1.0  # s
_SETTLED = 0.1  # s; before which it is still finding the state

_NAMES = {
    'joint_position': ('joint_position', 'rad'),
    'joint_velocity': ('joint_rate', 'rad/s'),
    'gyro': ('gyro', 'rad/s'),
    'attitude': ('attitude', 'rad'),
}


def series(before: Innovations, after: Innovations) -> tuple[Series, ...]:
    """Every channel along the record, under two models of one run.

    Args:
        before: The model as it stands.
        after: The extended model.
    """
    out = []
    for c, name in enumerate(CHANNELS):
        label, unit = _NAMES[name]
        for axis in range(before.n if name.startswith('joint') else 3):
            at, then = (_rows(f, c, axis) for f in (before, after))
            if len(at):
                out.append(
                    Series(
                        f'{label}/{_axis_name(before, name, axis)}',
                        unit,
                        before.row_times[at],
                        before.measured[at],
                        (before.data * before.stds)[at],
                        (after.data * after.stds)[then],
                        float(np.sqrt(np.mean(after.stds[then] ** 2))),
                    )
                )
    return (*_torques(before, after), *out)


def residuals(
    channels: tuple[Series, ...],
    white_before: tuple[ChannelFit, ...],
    white_after: tuple[ChannelFit, ...],
    joints: tuple[str, ...],
) -> tuple[Residual, ...]:
    """The channels' figures.

    Args:
        channels: From `series`.
        white_before: Fit test of the model as it stands.
        white_after: Fit test of the extended model.
        joints: Names of the joints.
    """
    p_before, p_after = (_whiteness(w, joints) for w in (white_before, white_after))
    return tuple(
        Residual(
            channel=s.channel,
            unit=s.unit,
            rms_before=float(np.sqrt(np.mean(s.before**2))),
            rms_after=float(np.sqrt(np.mean(s.after**2))),
            noise_floor=s.noise_floor,
            whiteness_p=p_after.get(s.channel, float('nan')),
            whiteness_p_before=p_before.get(s.channel, float('nan')),
        )
        for s in channels
    )


def _torques(before: Innovations, after: Innovations) -> list[Series]:
    """Unexplained torque on joints and base, window by window."""
    time, values, _ = _window_torques(before)
    _, later, spread = _window_torques(after)
    base = before.m - before.n
    names = [f'angular_momentum/{axis}' for axis in 'xyz'[:base]]
    names += [f'joint_torque/{joint}' for joint in before.process.robot.joints]
    floor = np.sqrt(np.mean(spread**2, axis=0))
    return [
        Series(names[i], 'N m', time, np.zeros(0), values[:, i], later[:, i], float(floor[i]))
        for i in [*range(base, before.m), *range(base)]
    ]


def _window_torques(filtered: Innovations) -> tuple[Array, Array, Array]:
    """Middle of each window, (M, m) constant torques that explain it best, and their stds.

    On the base a torque is the rate at which angular momentum seems to change. Windows far enough
    apart do not see each other, so their columns are computed together.
    """
    times, m = filtered.time_base.times, filtered.m
    count = max(1, int((times[-1] - times[0] - _START - _MEMORY) / _WINDOW))
    # the first second still finds the state
    starts = times[0] + _START + _WINDOW * np.arange(count)
    apart = round(_MEMORY / _WINDOW)
    values, spread = np.zeros((count, m)), np.zeros((count, m))
    unit = filtered.rate_by_impulse
    for comb in range(min(apart, count)):
        phase = (times - starts[0]) / _WINDOW
        inside = (phase >= 0.0) & ((np.floor(phase).astype(int) - comb) % apart == 0)
        columns = filtered.columns(Columns(unit * inside[:, None, None], {}))
        for w in range(comb, count, apart):
            rows = (filtered.row_times >= starts[w]) & (filtered.row_times < starts[w] + _MEMORY)
            gram = Gram.of(columns[rows], filtered.data[rows])
            inverse = np.linalg.pinv(gram.matrix, hermitian=True)
            values[w] = inverse @ gram.vector
            spread[w] = np.sqrt(np.diag(inverse))
    return starts + 0.5 * _WINDOW, values, spread


def _rows(filtered: Innovations, channel: int, axis: int) -> IntArray:
    """Rows of one axis once the state is found."""
    rows = filtered.time_base.rows
    settled = filtered.row_times > filtered.time_base.times[0] + _SETTLED
    return np.flatnonzero(settled & (rows.channel == channel) & (rows.axis == axis))


def _axis_name(filtered: Innovations, channel: str, axis: int) -> str:
    return filtered.process.robot.joints[axis] if channel.startswith('joint') else 'xyz'[axis]


def _whiteness(fits: tuple[ChannelFit, ...], joints: tuple[str, ...]) -> dict[str, float]:
    out = {}
    for fit in fits:
        axis = joints[fit.axis] if fit.channel.startswith('joint') else 'xyz'[fit.axis]
        out[f'{_NAMES[fit.channel][0]}/{axis}'] = fit.p_value
    # a missing torque shows in the rates that it drives
    for joint in joints:
        if f'joint_rate/{joint}' in out:
            out[f'joint_torque/{joint}'] = out[f'joint_rate/{joint}']
    for axis in 'xyz':
        if f'gyro/{axis}' in out:
            out[f'angular_momentum/{axis}'] = out[f'gyro/{axis}']
    return out
