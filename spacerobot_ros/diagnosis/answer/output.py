"""A diagnosis as plain values: `diagnosis.json` (schema 3, docs/diagnosis.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ...effects.effect import Effect
from ...effects.parameter import Parameter
from ...json_values import json_fields, json_value
from .cause import Cause
from .closed_loop_gain import ClosedLoopGain
from .result import Diagnosis

SCHEMA = 3
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
    events: dict[str, Any] = dict.fromkeys(('events', 'possible_events', 'event_limits'))
    if diagnosis.events is not None:
        events = json_fields(diagnosis.events)
    values = {
        'schema': SCHEMA,
        **json_fields(diagnosis),
        'causes': causes,
        'residuals': [json_fields(r) | {'appears': None} for r in diagnosis.residuals],
        'closed_loop': closed_loop,
        'extended_model': EXTENDED_MODEL,
        'minor': [_cause(cause) for cause in diagnosis.minor],
        'recordings': diagnosis.recordings or None,
        'calibration': [_calibration(effect) for effect in diagnosis.calibration],
        **events,
    }
    return dict(json_value(values))


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        'effect': cause.applied.id,
        'where': cause.applied.where,
        'title': cause.applied.title,
        'parameters': {
            name: json_fields(estimated) | {'threshold': relevance(cause.thresholds[name])}
            for name, estimated in cause.parameters.items()
        },
        'evidence': cause.evidence,
        'indistinguishable_from': cause.rivals,
        'relevant': cause.relevant,
        'constant_p': cause.constant_p,
        'held_out_recordings': cause.held_out_recordings,
        'recordings': cause.applied.recordings,
    }


def _calibration(effect: Effect) -> dict[str, Any]:
    return {
        'effect': effect.id,
        'where': effect.where,
        'parameters': dict(effect.values),
        'recordings': effect.recordings,
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
