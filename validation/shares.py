"""How often something happened, and how sure that share is."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from scipy.stats import binomtest

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
        low, high = binomtest(self.hits, self.total).proportion_ci(method='wilson')
        return float(low), float(high)

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
