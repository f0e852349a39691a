"""Motions of one robot within its limits, free or fixed base, whatever they are flown for."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.state import State, initial_state
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array
from .family import MotionFamily
from .free_base import BaseMotion, FreeBase, Start
from .limits import Limits

_FINE = 4  # times as many nodes for the final check of the limits
_NODES = 40  # a cycle of the highest harmonic


class Bounded(Protocol):
    """Motions that must keep limits.

    Attributes:
        family: Motions at the nodes. fine: The same on a finer grid.
    """

    family: MotionFamily
    fine: MotionFamily

    def worst_use(self, x: Array, family: MotionFamily) -> Array:
        """(B,) largest use of any limit by candidates x (B, size), 1 at the limit."""


class Motions:
    """Fourier motions of one duration, with the base's own and the torques they take.

    Args:
        robot: As the model believes it to be, true rotors locked.
        settings: `excitation` has limits and harmonics, `initial` the start.
        duration: [s].

    Raises:
        ConfigurationError: limits of the wrong length, or a robot whose free base can't be
            followed (prismatic joints).
    """

    def __init__(self, robot: Robot, settings: Settings, duration: float) -> None:
        options = settings.excitation
        self.settings, self.robot = settings, robot
        self.limits = Limits.of(robot, options)
        nodes = max(120, _NODES * options.harmonics)
        start = initial_state(robot, settings.initial)
        times = np.linspace(0.0, duration, nodes + 1)
        self.family = MotionFamily(duration, options.harmonics, start.q, times)
        self.fine = self.family.at(np.linspace(0.0, duration, _FINE * nodes + 1))
        self.start = Start(start.q_WB_xyzw, start.omega_WB_B)
        self._base = FreeBase(robot) if robot.is_free else FixedBase(robot)

    def move(self, x: Array, family: MotionFamily) -> BaseMotion:
        """Motion of candidates x (B, size) at a family's times."""
        return self._base.move(family.times, *family.motion(x), self.start)

    def worst_use(self, x: Array, family: MotionFamily) -> Array:
        """(B,) largest use of any limit; zero where nothing is limited."""
        fractions = self.limits.fractions(self.move(x, family))
        return np.asarray(np.max(fractions, axis=(1, 2), initial=0.0))


class FixedBase:
    """A robot on the ground whose joints follow given motions; only torques are to be found.

    Args:
        robot: Fixed base.
    """

    def __init__(self, robot: Robot) -> None:
        self._dynamics = Dynamics(robot)

    def move(self, time: Array, q: Array, qd: Array, qdd: Array, start: Start) -> BaseMotion:
        """See `FreeBase.move`; the base rests."""
        batch, steps, n = q.shape
        torque = np.empty_like(q)
        zeros = np.zeros(3)
        for b in range(batch):
            for t in range(steps):
                state = State(zeros, start.attitude_xyzw, q[b, t], zeros, zeros, qd[b, t])
                torque[b, t] = self._dynamics.inverse(state, np.zeros(6), qdd[b, t])[1]
        return BaseMotion(
            time,
            q,
            qd,
            qdd,
            omega=np.zeros((batch, steps, 3)),
            R_WB=np.broadcast_to(np.eye(3), (batch, steps, 3, 3)),
            torque=torque,
            inverse=np.zeros((batch, steps, 3, 3)),
            coupling=np.zeros((batch, steps, 3, n)),
            h_W=np.zeros((batch, 3)),
        )
