"""Commanded torques of the simulator: the last ones, and in lockstep the answer it waits for."""

from __future__ import annotations

import sys

import numpy as np

from ..errors import MessageRejectedError
from ..types import Array, Vector6


class HeldCommands:
    """Torques held from one command to the next, and zero once the command is too old.

    Args:
        n_joints: Number of manipulator joints.
        longest: Periods after which a held torque falls to zero.
    """

    def __init__(self, n_joints: int, longest: float) -> None:
        self._n, self._longest = n_joints, longest
        self.clear()

    def clear(self) -> None:
        """No command yet."""
        self._tau, self._wrench = np.zeros(self._n), np.zeros(6)
        self._tau_step = self._wrench_step = -sys.maxsize

    def set_tau(self, tau: Array, step: int) -> None:
        """Take joint torques (n,) at a step."""
        self._tau, self._tau_step = tau, step

    def set_wrench(self, wrench: Vector6, step: int) -> None:
        """Take a wrench (6,) on the base at a step."""
        self._wrench, self._wrench_step = wrench, step

    def is_fresh(self, step: int) -> bool:
        """Whether there is a joint command, not too old at a step."""
        return step - self._tau_step <= self._longest

    def tau(self, step: int, *, forever: bool) -> Array:
        """(n,) joint torques of a step.

        Args:
            step: The step.
            forever: Whether a command stays in force however old it is.
        """
        return self._tau if forever or self.is_fresh(step) else np.zeros(self._n)

    def wrench(self, step: int, *, forever: bool) -> Vector6 | None:
        """(6,) wrench on the base at a step, as `tau`; None where there is none."""
        return self._wrench if forever or step - self._wrench_step <= self._longest else None


class Answer:
    """The commands that belong to one joint sample, awaited in lockstep.

    Args:
        needs_base: Whether a torque on the base belongs to each answer.
    """

    def __init__(self, needs_base: bool) -> None:
        self.needs_base = needs_base
        self.clear()

    def clear(self) -> None:
        """Nothing is awaited."""
        self.stamp_ns: int | None = None
        self._tau: Array | None = None
        self._wrench: Vector6 | None = None

    def ask(self, stamp_ns: int) -> None:
        """Await the commands with a stamp [ns]."""
        self.clear()
        self.stamp_ns = stamp_ns

    def give_tau(self, stamp_ns: int, tau: Array) -> None:
        """Take joint torques (n,).

        Raises:
            MessageRejectedError: not the stamp that is awaited.
        """
        self._check(stamp_ns)
        self._tau = tau

    def give_wrench(self, stamp_ns: int, wrench: Vector6) -> bool:
        """Take a wrench (6,) on the base; False where it is no part of an answer.

        Raises:
            MessageRejectedError: not the stamp that is awaited.
        """
        if not self.needs_base:
            return False
        self._check(stamp_ns)
        self._wrench = wrench
        return True

    def complete(self) -> tuple[Array, Vector6 | None] | None:
        """Torques and wrench, once all are there."""
        if self._tau is None or (self.needs_base and self._wrench is None):
            return None
        return self._tau, self._wrench

    def _check(self, stamp_ns: int) -> None:
        if self.stamp_ns is None:
            raise MessageRejectedError('lockstep: no command is awaited')
        if stamp_ns != self.stamp_ns:
            raise MessageRejectedError(
                f'lockstep: stamp {stamp_ns * 1e-9:.6f} s, awaited is {self.stamp_ns * 1e-9:.6f} s'
            )
