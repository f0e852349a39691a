r"""The regressors of a free-flying tree, from its compiled loops.

Velocities are quasi-velocities V = [v_WB_B; omega_WB_B; q'], their derivatives those of the
components. With wheels their momentum is among the parameters (names in `tree`).
"""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from .regressor_kernel import fill_momentum, fill_slotine_li, place
from .tree import build_tree


class Regressors:
    """Regressors of one robot; keeps scratch memory, so one object serves one thread.

    Args:
        robot: Free-flying robot; only its tree and the places of its wheels matter.

    Raises:
        ConfigurationError: fixed base or free rotors.
    """

    def __init__(self, robot: Robot) -> None:
        self.tree = build_tree(robot)
        bodies = self.tree.n_bodies
        self.shape = (self.tree.rows, self.tree.columns)
        self.rotations = np.tile(np.eye(3), (bodies, 1, 1))
        self.positions = np.zeros((bodies, 3))
        self.motion = np.zeros((6, bodies, 3))
        self.columns = np.zeros((2, 10, 3))

    def slotine_li(self, q: Array, V: Array, Vr: Array, Ar: Array) -> Array:
        """(6 + n, p) Y_SL with Y_SL pi = M(q) A_r + C(q, V) V_r, and M' - 2 C skew.

        Body by body W(a_r + 1/2 v x v_r) + 1/2 [v x* W(v_r) + v_r x* W(v)], wheels -h x w_r.

        Args:
            q: (n,) joint positions.
            V: (6 + n,) velocity.
            Vr: (6 + n,) reference velocity.
            Ar: (6 + n,) derivative of its components.
        """
        Y = np.zeros(self.shape)
        self._place(q)
        fill_slotine_li(
            self.tree,
            self.rotations,
            self.positions,
            *(np.array(x, dtype=float) for x in (V, Vr, Ar)),
            self.motion,
            self.columns,
            Y,
        )
        return Y

    def momentum(self, q: Array, V: Array) -> tuple[Array, Array]:
        """(6 + n, p) twice: Y_p pi = M V, wheels included, and Y_c pi = C^T V.

        The generalised momentum obeys d/dt (Y_p pi) - Y_c pi = u.

        Args:
            q: (n,) joint positions.
            V: (6 + n,) velocity.
        """
        Yp, Yc = np.zeros(self.shape), np.zeros(self.shape)
        self._place(q)
        place_args = (self.tree, self.rotations, self.positions)
        V = np.array(V, dtype=float)
        fill_momentum(*place_args, V, self.motion, self.columns, Yp, Yc)
        return Yp, Yc

    def _place(self, q: Array) -> None:
        place(self.tree, np.array(q, dtype=float), self.rotations, self.positions)
