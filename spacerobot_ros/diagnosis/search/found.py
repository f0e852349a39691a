"""What a search has found: the chosen causes, why, and whether each proved sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...effects.effect import Key
from ...estimation.fit import Fit
from ...estimation.inference.evidence import Score
from ...estimation.refit import refine
from ..limits import CANCELLED
from .pool import Judged
from .soundness import Soundness


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A chosen cause, why, and what might stand in its place.

    Args:
        key: Effect and place.
        score: Its score when it was chosen.
        rivals: (effect, place, gap in log evidence) that fit nearly as well.
    """

    key: Key
    score: Score
    rivals: tuple[tuple[str, str | None, float], ...]


@dataclass(frozen=True, eq=False)
class Found:
    """Result of the search.

    Args:
        null: The model as it stands.
        fit: The model with all causes.
        choices: One a cause of `fit`, in the same order.
        checks: Whether each proved sound.
        first: Every candidate's score against the model as it stands, best first.
        is_complete: Whether the search ended because nothing more was wanted.
    """

    null: Fit
    fit: Fit
    choices: tuple[Choice, ...]
    checks: tuple[Soundness, ...]
    first: tuple[Judged, ...]
    is_complete: bool

    @cached_property
    def sound(self) -> Fit:
        """The fit with only the sound causes."""
        return self.only([i for i, check in enumerate(self.checks) if check.is_sound])

    @property
    def is_cancelled(self) -> bool:
        """Whether the sound causes undo most of what each of them does.

        Known inputs that are wrong count as one: thrusters are mounted against each other, and
        what each does follows its own command.
        """
        causes = self.sound.causes
        each = [self.sound.changed(i) for i, c in enumerate(causes) if c.group != 'inputs']
        inputs = [self.sound.changed(i) for i, c in enumerate(causes) if c.group == 'inputs']
        each += [np.sum(inputs, axis=0)] if inputs else []
        apart, together = sum(float(x @ x) for x in each), float(np.sum(np.sum(each, axis=0) ** 2))
        return apart > CANCELLED * together

    def only(self, kept: Sequence[int]) -> Fit:
        """The fit with only some of its causes."""
        if list(kept) == list(range(len(self.choices))):
            return self.fit
        return refine(self.fit.run, [self.fit.causes[i] for i in kept]) if kept else self.null
