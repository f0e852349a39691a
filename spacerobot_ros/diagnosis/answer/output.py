"""A diagnosis as plain values: `diagnosis.json` (schema 1, docs/diagnosis.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ...effects.effect import Effect
from ...effects.parameter import Parameter
from ...json_values import json_value
from ..events.event import events_to_dict
from .cause import Cause
from .closed_loop_gain import ClosedLoopGain
from .result import Diagnosis, Gain, Leftover, Order

SCHEMA = 2
EXTENDED_MODEL = 'extended_model.yaml'


def to_dict(
    diagnosis: Diagnosis,
    added: Sequence[Effect] = (),
    closed_loop: ClosedLoopGain | None = None,
) -> dict[str, Any]:
    """Everything a diagnosis says, infinite and undefined numbers as null.

    Args:
        diagnosis: The answer.
        added: The causes as they stand in the extended model, in their order.
        closed_loop: What the extended model is worth to a controller, where that was measured.
    """
    every = (cause.applied for cause in diagnosis.causes)
    lasting = [effect for effect in every if effect.recordings is None]
    names = iter([effect.name for effect in added or lasting])
    causes = [
        _cause(cause) | {'name': next(names) if cause.applied.recordings is None else None}
        for cause in diagnosis.causes
    ]
    values: dict[str, Any] = {
        'schema': SCHEMA,
        'verdict': diagnosis.verdict,
        'sentence': diagnosis.sentence,
        'causes': causes,
        'residuals': [{**asdict(r), 'appears': None} for r in diagnosis.residuals],
        'gain': _gain(diagnosis.gain),
        'closed_loop': None if closed_loop is None else _closed_loop(closed_loop),
        'extended_model': EXTENDED_MODEL,
        'minor': [_cause(cause) for cause in diagnosis.minor],
        'ranking': [asdict(ranked) for ranked in diagnosis.ranking],
        'fit_p': diagnosis.fit_p,
        'null_p': diagnosis.null_p,
        'next_motion': list(diagnosis.next_motion),
        'notes': list(diagnosis.notes),
        'recordings': [asdict(r) for r in diagnosis.recordings] or None,
        'friction': [asdict(law) for law in diagnosis.friction],
        'leftover': None
        if diagnosis.leftover is None
        else [_leftover(entry) for entry in diagnosis.leftover],
        'ratios': [asdict(ratio) for ratio in diagnosis.ratios],
        'free_motion': [asdict(joint) for joint in diagnosis.free_motion],
        'orders': None
        if diagnosis.orders is None
        else [_order(order) for order in diagnosis.orders],
        'calibration': [_calibration(effect) for effect in diagnosis.calibration],
        **events_to_dict(diagnosis.events),
    }
    return dict(json_value(values))


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        'effect': cause.applied.id,
        'where': cause.applied.where,
        'title': cause.applied.title,
        'parameters': {
            name: {**asdict(estimated), 'threshold': relevance(cause.thresholds[name])}
            for name, estimated in cause.parameters.items()
        },
        'evidence': asdict(cause.evidence),
        'indistinguishable_from': [asdict(rival) for rival in cause.rivals],
        'relevant': cause.relevant,
        'constant_p': cause.constant_p,
        'held_out_recordings': cause.held_out_recordings,
        'recordings': cause.applied.recordings,
    }


def _order(order: Order) -> dict[str, Any]:
    """Its channel is for the report: an order's fields are fixed."""
    return {name: value for name, value in asdict(order).items() if name != 'channel'}


def _calibration(effect: Effect) -> dict[str, Any]:
    return {
        'effect': effect.id,
        'where': effect.where,
        'parameters': dict(effect.values),
        'recordings': effect.recordings,
    }


def _leftover(entry: Leftover) -> dict[str, Any]:
    return {
        'channel': entry.channel,
        'depends_on': entry.depends_on,
        'form': entry.form,
        'coefficients': [asdict(c) for c in entry.coefficients],
        'resembles': entry.resembles,
        'kind': entry.kind or None,
        'p_value': entry.p_value,
        'share': entry.share,
        'held_out_gain': entry.held_out_gain,
        'placebo_gain': entry.placebo_gain,
        'other_recording': entry.other_recording,
        'indistinguishable_from': [asdict(rival) for rival in entry.rivals],
        'learned': None if entry.applied is None else entry.applied.name,
        'one_speed': entry.one_speed,
    }


def relevance(parameter: Parameter) -> float | None:
    """Magnitude from which a parameter is worth naming, in its own unit; None: it alone is not.

    Of a time constant it is the longest that matters.
    """
    if parameter.role == 'linear' and parameter.relevant > 0.0:
        return parameter.relevant
    if parameter.role == 'reciprocal' and parameter.relevant > 0.0:
        return 1.0 / parameter.relevant
    if parameter.role == 'square' and parameter.relevant > 0.0:
        return math.sqrt(parameter.relevant)
    return None


def _gain(gain: Gain) -> dict[str, Any]:
    return {
        'held_out_rmse_before': gain.before,
        'held_out_rmse_after': gain.after,
        'ratio': gain.ratio,
        'held_out_rmse_placebo': gain.placebo,
    }


def _closed_loop(gain: ClosedLoopGain) -> dict[str, Any]:
    return {
        'task': gain.task,
        'duration': gain.duration,
        'rms_before': gain.rms_before,
        'rms_after': gain.rms_after,
        'ratio': gain.ratio,
        'unit': gain.unit,
        'joints': {
            joint: {'unit': gain.units[joint], 'rms_before': before, 'rms_after': after}
            for joint, (before, after) in gain.joints.items()
        },
    }
