"""How far data deviate from the model, and whether new ones contradict those before."""

from __future__ import annotations

from dataclasses import dataclass

from .summary import unexplained
from .validity_limits import LARGEST_CHI2, SUSPICIOUS, SUSPICIOUS_SCATTER

_FORGIVEN = 2  # stretches in a row that contradict what was learned, before that is doubted


@dataclass(frozen=True, slots=True)
class Misfit:
    """Of the data that were used.

    Args:
        residual: Sum of squared residuals of the segment.
        rows: Their number.
        contradicted: Stretches in a row that contradict these, and were not used.
    """

    residual: float = 0.0
    rows: int = 0
    contradicted: int = 0

    @property
    def is_lasting(self) -> bool:
        """Whether too much contradicts what was learned for that to be trusted."""
        return self.contradicted > _FORGIVEN

    def doubt(self, residual: float, rows: int) -> str:
        """What to say where the misfit with new data tells that they can't be of the same model.

        By what they add to it: a long run before them must not hide them.
        """
        chi2 = (residual - self.residual) / max(1, rows - self.rows)
        return '' if chi2 <= LARGEST_CHI2 else unexplained(chi2)

    def suspicion(self, residual: float, rows: int) -> str:
        """What to say of a stretch that is clearly worse than those before.

        A single one is left out; where the next is, too, noise may have grown.
        """
        new = max(1, rows - self.rows)
        if not self.rows or self.contradicted:
            return ''
        chi2, usual = (residual - self.residual) / new, self.residual / self.rows
        limit = max(SUSPICIOUS, 1.0 + SUSPICIOUS_SCATTER * (2.0 / new) ** 0.5)
        return '' if chi2 <= limit * usual else unexplained(chi2)

    def left_out(self) -> Misfit:
        """Of another segment, behind data that were not used."""
        return Misfit(contradicted=self.contradicted + 1)

    def anew(self) -> Misfit:
        """Of another segment."""
        return Misfit(contradicted=self.contradicted)
