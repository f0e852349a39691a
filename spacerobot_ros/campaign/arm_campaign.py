"""Campaign of arms whose noise nobody knows: causes hidden in one recording, or between two.

Every machine is recorded as it should be, then with one cause of three times the size from which
that very record would name it; likewise two recordings of other motions, between which nothing
changed, or one thing.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from ..diagnosis.answer.result import Estimated, Rival
from ..diagnosis.arm_conclusion import conclude_arm
from ..diagnosis.arms import find_arm_causes
from ..diagnosis.change_conclusion import conclude_changes
from ..diagnosis.compare import compare
from ..diagnosis.selection import Selection
from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..estimation.columns import Candidate
from ..estimation.observations import observed
from ..types import Array
from .arm_campaign_tables import judge as judge
from .arm_campaign_tables import results as results
from .arm_campaign_tables import tables as tables
from .description import Record, key
from .real_arm import HIDDEN, RealArm, arm_file

MULTIPLE = 3.0
"""Strength of what is hidden, by its own limit."""
_REACH = 0.1  # m, of a mass that is added to a body
_LARGEST = 5.0  # plausible sizes
_LAST = 'link_6'
CAUSES = (*(name for name in HIDDEN if name != 'inertial_parameters'), 'payload', 'body')
"""What is hidden, in turn; a body's addition is a payload at the last link."""


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every machine diagnosed and compared, as it should be and with one cause, in turn."""
    return [key(kind, seed, CAUSES[seed % len(CAUSES)]) for seed in range(runs) for kind in _ASKED]


def run(key: str) -> Record:
    """Ask about the machine as it should be, hide a cause, ask again."""
    kind, seed, cause = json.loads(key)
    started = time.perf_counter()
    clean, selection = _ASKED[kind](seed, ())
    wall = time.perf_counter() - started
    hidden = _drawn(selection, cause, np.random.default_rng([seed, 11]))
    single = _ASKED[kind](seed, (hidden,))[0] if hidden else None
    return {
        'kind': kind,
        'cause': cause,
        'hidden': hidden and {'effect': hidden.id, 'where': hidden.where, 'values': hidden.values},
        'clean': clean,
        'single': single,
        'wall_s': wall,
    }


def _diagnosed(seed: int, hidden: tuple[Effect, ...]) -> tuple[list[Record], Selection]:
    """What is named in one recording, and the choice."""
    file = arm_file()
    record = observed(RealArm(seed, hidden).record(0), file.robot)
    kinds = list(CATALOGUE.values())
    found = find_arm_causes([record], file.robot, file.effects, kinds, lambda what, share: None)
    causes = conclude_arm(found, None, ()).causes
    return [
        _plain(c.applied.id, c.applied.where, c.parameters, c.rivals) for c in causes
    ], found.selection


def _compared(seed: int, hidden: tuple[Effect, ...]) -> tuple[list[Record], Selection]:
    """What is said to have changed between two recordings, and the choice."""
    file = arm_file()
    before, after = [RealArm(seed).record(0)], [RealArm(seed, hidden).record(1)]
    found = compare(before, after, file.robot, file.effects)
    changes = conclude_changes(found).changes
    return [_plain(c.effect, c.where, c.parameters, ()) for c in changes], found.selection


_ASKED = {'diagnose': _diagnosed, 'compare': _compared}


def _plain(
    effect: str, where: str | None, parameters: Mapping[str, Estimated], rivals: Sequence[Rival]
) -> Record:
    """A cause with its values and their standard deviations."""
    return {
        'effect': effect,
        'where': where,
        'rivals': [[r.effect, r.where] for r in rivals],
        'values': {name: [e.value, e.std] for name, e in parameters.items()},
    }


def _drawn(selection: Selection, cause: str, rng: np.random.Generator) -> Effect | None:
    """The cause at a place that is drawn, three times as large as its limit.

    None where that is more than an arm can have, or is not looked for.
    """
    rows = selection.rows
    fitting = [i for i in selection.live if _fits(rows.candidates[i], cause)]
    if not fitting:
        return None
    i = fitting[int(rng.integers(len(fitting)))]
    candidate = rows.candidates[i]
    direction = _direction(candidate, rng)
    size = MULTIPLE * selection.limit(i, direction) * direction
    if not np.all(np.abs(size) <= _LARGEST * candidate.sizes):
        return None
    values = candidate.values(size)
    if cause == 'joint_torque_constant':  # its coefficient is of measured torques
        values['gain'] = 1.0 / (1.0 - float(size[0]))
    return candidate.applied(values)


def _fits(candidate: Candidate, cause: str) -> bool:
    is_last = candidate.where == _LAST
    wanted = {'payload': is_last, 'body': not is_last}.get(cause)
    if wanted is None:
        return candidate.kind.id == cause
    return candidate.kind.id == 'inertial_parameters' and wanted


def _direction(candidate: Candidate, rng: np.random.Generator) -> Array:
    """Proportions of the coefficients: a mass at one point, else of the sizes that are usual."""
    if candidate.kind.id == 'inertial_parameters':
        point = pin.Inertia(1.0, rng.normal(0.0, _REACH, 3), np.zeros((3, 3)))
        return np.asarray(point.toDynamicParameters())
    first = candidate.kind.parameters[0]
    out = rng.standard_normal(len(candidate.sizes)) * candidate.sizes
    is_one_sided = max(first.minimum, first.above) >= first.nominal and len(out) == 1
    return np.abs(out) if is_one_sided else out
