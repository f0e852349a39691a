r"""Reduced joint equation H(q) q'' + c = tau from identified minimal parameters.

Momentum tells all that the equation needs (`dynamics.blocks`): eqs. (17)-(20) of the
identification paper with the joint term that they lack (docs/equations.md).
"""

from __future__ import annotations

import numpy as np

from ..dynamics.reduction import ReducedEquation, reduced
from ..errors import IdentificationError
from ..estimation.unknowns.minimal import MinimalSet, minimal_set
from ..model.robot import Robot
from ..types import Array, Vector3
from .estimate import Estimate


class EstimatedDynamics:
    """Reduced equation rebuilt from minimal parameters and wheel momentum.

    Args:
        robot: Gives the tree, the servicer's wheels and the links that carry the unknown wheels.
        minimal: The minimal set that `parameters` belong to.
        parameters: (k,) minimal parameters, in its units.
        aam: (3 n_links,) wheel momentum of the captured body, as `Robot.target_momentum` [N m s].
    """

    def __init__(self, robot: Robot, minimal: MinimalSet, parameters: Array, aam: Array) -> None:
        self._tree, self._weights = minimal.tree, minimal.matrix(parameters)
        self._wheels = np.zeros((len(robot.bodies), 3))
        for g in robot.with_target_momentum(aam).gyrostats:
            self._wheels[g.body] += g.body_momentum

    @classmethod
    def from_estimate(cls, robot: Robot, structure: str, estimate: Estimate) -> EstimatedDynamics:
        """Take the parameters of an estimate made for this robot.

        Raises:
            IdentificationError: the estimate's parameters or links are not this robot's, or can't
                be used.
        """
        estimate.check()
        minimal = minimal_set(robot, structure)
        if estimate.parameter_names != minimal.names:
            raise IdentificationError(
                f'estimate: its {len(estimate.parameter_names)} parameters are not the '
                f'{len(minimal)} of this robot ({structure} structure)'
            )
        links = tuple(g.link for g in robot.target_wheels)
        if estimate.aam_links != links:
            raise IdentificationError(
                f'estimate: its wheels are on {estimate.aam_links}, the model has them on {links}'
            )
        return cls(robot, minimal, estimate.parameters, estimate.aam)

    def reduced(
        self, q: Array, qd: Array, omega_WB_B: Vector3, joint_reaction: bool = True
    ) -> ReducedEquation:
        """Reduced equation at one state.

        Args:
            q: (n,) joint positions.
            qd: (n,) joint rates.
            omega_WB_B: (3,) body rate of the base [rad/s].
            joint_reaction: False omits the wheels' torque on the joints, as the paper prints c.

        Returns:
            H (n, n) and c (n,).

        Raises:
            IdentificationError: the parameters give a singular or indefinite inertia at this
                state.
        """
        u = np.concatenate([omega_WB_B, qd])[None]
        told = self._weights, self._wheels, joint_reaction
        found, is_definite = reduced(self._tree.equation(q[None], u, *told)[0], 3)
        if not is_definite:
            why = 'estimate: its inertia is not positive definite at this state'
            raise IdentificationError(why)
        return found
