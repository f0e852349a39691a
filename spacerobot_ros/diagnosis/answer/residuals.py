"""Prediction errors in physical units, channel by channel, under two models of one run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.filters.prediction_rows import LABELS
from ...estimation.rows import ChannelError, ChannelFit
from ...types import Array
from .result import Residual, Series


def series(before: Sequence[ChannelError], after: Sequence[ChannelError]) -> tuple[Series, ...]:
    """Every channel along the record, under two models of one run.

    Args:
        before: Of the model as it stands.
        after: Of the extended model.
    """
    return tuple(
        Series(
            b.channel,
            b.unit,
            b.time,
            b.measured,
            b.error,
            # what moves stamps moves the times at which an error is known
            a.error if len(a.time) == len(b.time) else np.interp(b.time, a.time, a.error),
            a.noise_floor,
        )
        for b, a in zip(before, after, strict=True)
    )


def residuals(
    channels: tuple[Series, ...],
    white_before: tuple[ChannelFit, ...],
    white_after: tuple[ChannelFit, ...],
    joints: tuple[str, ...],
) -> tuple[Residual, ...]:
    """The channels' figures.

    Args:
        channels: From `series`.
        white_before: Whiteness of the model as it stands.
        white_after: Whiteness of the extended model.
        joints: Names of the joints.
    """
    p_before, p_after = (_whiteness(w, joints) for w in (white_before, white_after))
    return tuple(
        Residual(
            channel=s.channel,
            unit=s.unit,
            rms_before=rms(s.before),
            rms_after=rms(s.after),
            noise_floor=s.noise_floor,
            whiteness_p=p_after.get(s.channel, float('nan')),
            whiteness_p_before=p_before.get(s.channel, float('nan')),
        )
        for s in channels
    )


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _whiteness(fits: tuple[ChannelFit, ...], joints: tuple[str, ...]) -> dict[str, float]:
    out = {}
    for fit in fits:
        axis = joints[fit.axis] if fit.channel.startswith('joint') else 'xyz'[fit.axis]
        out[f'{LABELS[fit.channel][0]}/{axis}'] = fit.p_value
    # a missing torque shows in the rates that it drives
    for joint in joints:
        if f'joint_rate/{joint}' in out:
            out[f'joint_torque/{joint}'] = out[f'joint_rate/{joint}']
    for axis in 'xyz':
        if f'gyro/{axis}' in out:
            out[f'angular_momentum/{axis}'] = out[f'gyro/{axis}']
    return out
