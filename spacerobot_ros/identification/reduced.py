r"""Reduced joint equation H(q) q'' + c = tau from identified minimal parameters.

Lagrange's equations in the quasi-velocities u = [omega_WB_B; q'] with the inertia Mu(q) = [[D,
Dq], [Dq^T, Dqq]]:

    base bias   n0 = (Mu' u)_0 + w0 x (Mu u)_0 + w0 x h0 + sum_b w_b x R_b h_b
    joint bias  nq = (Mu' u)_q - 1/2 u^T dMu/dq u + sum_b F_b^T (w_b x R_b h_b)
    H = Dqq - Dq^T D^-1 Dq          c = nq - Dq^T D^-1 n0

eqs. (17)-(20) of the identification paper with the joint term that they lack (docs/equations.md).
"""

from __future__ import annotations

import numpy as np

from ..dynamics.blocks import BlockTree
from ..dynamics.equations import ReducedEquation
from ..errors import IdentificationError
from ..estimation.minimal import MinimalSet, minimal_set
from ..model.robot import Robot
from ..types import Array, Vector3
from .estimate import Estimate


class EstimatedDynamics:
    """Reduced equation rebuilt from minimal parameters and wheel momentum.

    Args:
        robot: Gives the tree, the servicer's wheels and the links that carry the unknown wheels.
        minimal: The minimal set that `parameters` belong to.
        parameters: (k,) minimal parameters [kg m^2].
        aam: (3 n_links,) wheel momentum of the captured body, as `Robot.target_momentum` [N m s].
    """

    def __init__(self, robot: Robot, minimal: MinimalSet, parameters: Array, aam: Array) -> None:
        self._tree = BlockTree(robot)
        self._pi = minimal.lift @ parameters
        believed = robot.with_target_momentum(aam)
        self._wheels = [(g.body, g.body_momentum) for g in believed.target_wheels]
        self._h0 = robot.servicer_wheels.body_momentum

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
            q: (n,) joint positions [rad].
            qd: (n,) joint rates [rad/s].
            omega_WB_B: (3,) body rate of the base [rad/s].
            joint_reaction: False omits the wheels' torque on the joints, as the paper prints c.

        Returns:
            H (n, n) and c (n,).

        Raises:
            IdentificationError: the parameters give a singular or indefinite inertia at this
                state.
        """
        u = np.concatenate([omega_WB_B, qd])
        rotations = self._tree.rotations(q[None])
        maps = self._tree.rate_maps(rotations)
        inertia, gradient = self._tree.inertia_gradient(rotations, maps, self._pi)
        Mu, dMu = inertia[0], gradient[0]
        bias = np.einsum('jab,j,b->a', dMu, qd, u)
        bias[3:] -= 0.5 * np.einsum('a,jab,b->j', u, dMu, u)
        bias[:3] += np.cross(omega_WB_B, Mu[:3] @ u + self._h0)
        for body, momentum in self._wheels:
            torque = np.cross(maps[0, body] @ u, rotations[0, body] @ momentum)
            bias[:3] += torque
            if joint_reaction:
                bias[3:] += maps[0, body, :, 3:].T @ torque
        try:
            np.linalg.cholesky(Mu)
        except np.linalg.LinAlgError as error:
            raise IdentificationError(
                'estimate: its inertia is not positive definite at this state'
            ) from error
        eliminated = np.linalg.solve(Mu[:3, :3], np.column_stack([Mu[:3, 3:], bias[:3]]))
        return ReducedEquation(
            Mu[3:, 3:] - Mu[3:, :3] @ eliminated[:, :-1], bias[3:] - Mu[3:, :3] @ eliminated[:, -1]
        )
