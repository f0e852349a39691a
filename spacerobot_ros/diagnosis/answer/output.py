"""A diagnosis as plain values: `diagnosis.json` (schema 1, docs/diagnosis.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...effects.effect import Effect
from ...effects.parameter import Parameter
from ...json_values import json_value
from .appearance import Appearance
from .closed_loop_gain import ClosedLoopGain
from .result import Cause, Diagnosis, Estimated, Gain, Ranked, Residual, Rival

SCHEMA = 1
EXTENDED_MODEL = 'extended_model.yaml'


def to_dict(
    diagnosis: Diagnosis,
    added: Sequence[Effect] = (),
    closed_loop: ClosedLoopGain | None = None,
    appearances: Mapping[str, Appearance] | None = None,
) -> dict[str, Any]:
    """Everything a diagnosis says, infinite and undefined numbers as null.

    Args:
        diagnosis: The answer.
        added: The causes as they stand in the extended model, in their order.
        closed_loop: What the extended model is worth to a controller, where that was measured.
        appearances: Where in the motion each channel's error appears, by channel.
    """
    seen = appearances or {}
    names = [effect.name for effect in added]
    causes = [
        {**_cause(cause), 'name': name}
        for cause, name in zip(diagnosis.causes, names or _ids(diagnosis), strict=True)
    ]
    values: dict[str, Any] = {
        'schema': SCHEMA,
        'verdict': diagnosis.verdict,
        'sentence': diagnosis.sentence,
        'causes': causes,
        'residuals': [_residual(r, seen.get(r.channel)) for r in diagnosis.residuals],
        'gain': _gain(diagnosis.gain),
        'closed_loop': None if closed_loop is None else _closed_loop(closed_loop),
        'extended_model': EXTENDED_MODEL,
        'minor': [_cause(cause) for cause in diagnosis.minor],
        'ranking': [_ranked(ranked) for ranked in diagnosis.ranking],
        'fit_p': diagnosis.fit_p,
        'null_p': diagnosis.null_p,
        'next_motion': list(diagnosis.next_motion),
        'notes': list(diagnosis.notes),
    }
    return dict(json_value(values))


def _ids(diagnosis: Diagnosis) -> list[str]:
    return [cause.applied.name for cause in diagnosis.causes]


def _cause(cause: Cause) -> dict[str, Any]:
    evidence = cause.evidence
    return {
        'effect': cause.applied.id,
        'where': cause.applied.where,
        'title': cause.applied.title,
        'parameters': {
            name: _estimated(estimated, cause.thresholds[name])
            for name, estimated in cause.parameters.items()
        },
        'evidence': {
            'log_likelihood_gain': evidence.log_likelihood_gain,
            'bic_gain': evidence.bic_gain,
            'p_value': evidence.p_value,
            'held_out_gain': evidence.held_out_gain,
            'placebo_gain': evidence.placebo_gain,
        },
        'indistinguishable_from': [_rival(rival) for rival in cause.rivals],
        'relevant': cause.relevant,
        'constant_p': cause.constant_p,
    }


def _estimated(estimated: Estimated, parameter: Parameter) -> dict[str, Any]:
    return {
        'value': estimated.value,
        'std': estimated.std,
        'unit': estimated.unit,
        'threshold': relevance(parameter),
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


def _rival(rival: Rival) -> dict[str, Any]:
    return {
        'effect': rival.effect,
        'where': rival.where,
        'bic_gap': rival.bic_gap,
        'motion': rival.motion,
    }


def _residual(residual: Residual, seen: Appearance | None) -> dict[str, Any]:
    return {
        'channel': residual.channel,
        'unit': residual.unit,
        'rms_before': residual.rms_before,
        'rms_after': residual.rms_after,
        'noise_floor': residual.noise_floor,
        'whiteness_p': residual.whiteness_p,
        'whiteness_p_before': residual.whiteness_p_before,
        'appears': None if seen is None else _appearance(seen),
    }


def _appearance(seen: Appearance) -> dict[str, Any]:
    return {'time': seen.time, 'with': seen.motion, 'correlation': seen.correlation}


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
        'unit': 'rad',
        'joints': {
            joint: {'rms_before': before, 'rms_after': after}
            for joint, (before, after) in gain.joints.items()
        },
    }


def _ranked(ranked: Ranked) -> dict[str, Any]:
    values: Mapping[str, float] = ranked.values
    return {
        'effect': ranked.effect,
        'where': ranked.where,
        'values': dict(values),
        'evidence': ranked.evidence,
        'log_likelihood_gain': ranked.log_likelihood_gain,
        'p_value': ranked.p_value,
    }
