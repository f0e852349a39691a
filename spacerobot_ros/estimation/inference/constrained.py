"""Bodies as constraints of a least-squares problem: unknown inertial parameters stay physical."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...dynamics.pseudo_inertia import BASIS, pseudo_inertia
from ...inference.interior_point import ConstrainedProblem as ConstrainedProblem
from ...types import Array, IntArray

NEXT_TO_NOTHING = np.array([1e-6, 0.0, 0.0, 0.0, 1e-9, 0.0, 1e-9, 0.0, 0.0, 1e-9])
"""(10,) a body far below any that is seen [kg, kg m, kg m^2]: what one that is put on is added to,
as it has to be a body by itself."""


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalBody:
    """A body of whose ten inertial parameters some are among the unknowns.

    Args:
        columns: (k,) places of these among the unknowns.
        file: (10,) what the unknowns are added to.
        which: (k,) of the ten, in the order of Pinocchio's `toDynamicParameters`.
    """

    columns: IntArray
    file: Array
    which: IntArray = field(default_factory=lambda: np.arange(10))

    @property
    def offset(self) -> Array:
        """(4, 4) pseudo-inertia in the file."""
        return pseudo_inertia(self.file)

    @property
    def basis(self) -> Array:
        """(k, 4, 4) derivatives of the pseudo-inertia by the unknowns."""
        return BASIS[self.which]

    @property
    def is_body(self) -> bool:
        """Whether it is one in the file."""
        try:
            np.linalg.cholesky(self.offset)
        except np.linalg.LinAlgError:
            return False
        return True
