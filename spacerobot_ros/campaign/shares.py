"""How often something happened, and how sure that share is."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

QUANTILE = 1.959964
"""Of two-sided 95 % intervals of a normal variable."""


@dataclass(frozen=True, slots=True)
class Share:
    """Hits among trials.

    Args:
        hits: How often.
        total: Of how many.
    """

    hits: int
    total: int

    @property
    def value(self) -> float:
        """Hits by trials; NaN without trials."""
        return self.hits / self.total if self.total else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the probability (Wilson, J. Am. Stat. Assoc. 22 (1927)).

        Without trials it is all from 0 to 1.
        """
        if not self.total:
            return 0.0, 1.0
        n, z2 = self.total, QUANTILE**2
        middle = (self.hits + 0.5 * z2) / (n + z2)
        half = math.sqrt(z2 * (self.hits * (n - self.hits) / n + 0.25 * z2)) / (n + z2)
        return max(middle - half, 0.0), min(middle + half, 1.0)

    def to_json(self) -> dict[str, Any]:
        """As in a campaign's JSON."""
        low, high = self.interval
        counts = {'hits': self.hits, 'total': self.total}
        return {**counts, 'value': self.value, 'low': low, 'high': high}

    def __str__(self) -> str:
        """The share with its interval: `0.95 (0.90 to 0.98) of 120`."""
        if not self.total:
            return '-'
        low, high = self.interval
        return f'{self.value:.3f} ({low:.3f} to {high:.3f}) of {self.total}'


def share_of(values: Iterable[bool]) -> Share:
    """The share of what is true."""
    listed = list(values)
    return Share(sum(listed), len(listed))
