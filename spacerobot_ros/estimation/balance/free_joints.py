r"""Joints without a motor predicted for some seconds, while the driven ones move as measured.

    H_pp q_p'' = -(H_pa q_a'' + c_p) + effects_p,    tau_p = 0

integrated from the first moment of each window, whose position and rate are those that come
closest to the window (two unknowns a joint): what is left is the model's, not of the start.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.integrate import RK4, rk_step
from ...effects.motion import Motion
from ...types import Array, IntArray
from ..trajectory.reference import Kinematics
from .balance import Balance

HORIZON = 2.0  # s
_STEP = 0.02  # s; RK4 is right to 1e-5 of a swing of 4 Hz
_SEARCHED = 0.1  # s, from start to start where no window fits
_MOST_STEPS = 20  # in one of these, where friction is stiff
_PASSES = 6
_SETTLED = 1e-9  # rad, rad/s: a change of the first state that shows nowhere
_NUDGE = 1e-4  # rad, rad/s: of differences by the first state


def predict_free_joints(balance: Balance, horizon: float = HORIZON) -> dict[str, Array]:
    """(W,) mean squared error of each window of every joint that has no motor, or one that is off.

    Args:
        balance: A model along a recording.
        horizon: Length of the windows, one after another [s].
    """
    arm = balance.arm
    per = max(2, round(horizon / arm.step))
    starts: dict[tuple[int, ...], list[int]] = {}
    first = 0
    while first + per < len(arm.times):
        inside = slice(first, first + per + 1)
        off = np.flatnonzero(arm.unpowered[inside].all(axis=0))
        if len(off) and arm.is_known[inside].all():
            starts.setdefault(tuple(off.tolist()), []).append(first)
            first += per
        else:
            first += max(1, round(_SEARCHED / arm.step))
    errors: dict[str, list[Array]] = {}
    for joints, own in starts.items():
        left = _Windows(balance, np.array(joints), arm.times[own], per * arm.step).errors()
        for joint, column in zip(joints, np.mean(left**2, axis=1).T, strict=True):
            errors.setdefault(balance.robot.joints[joint], []).append(column)
    return {joint: np.concatenate(parts) for joint, parts in errors.items()}


class _Windows:
    """W windows in which the same p joints are free.

    Args:
        balance: The model.
        joints: (p,) numbers of the joints.
        starts: (W,) [s].
        length: Of all [s].
    """

    def __init__(self, balance: Balance, joints: IntArray, starts: Array, length: float) -> None:
        self._process, self._joints = balance.process, joints
        robot, names = balance.robot, [balance.robot.joints[j] for j in joints]
        fastest = max([e.fastest(robot) for e in balance.effects if e.where in names], default=0.0)
        self._count = math.ceil(length / _STEP)
        self._inner = min(max(1, math.ceil(length / self._count * fastest / 2.0)), _MOST_STEPS)
        self._h = length / (self._count * self._inner)
        halves = 0.5 * self._h * np.arange(2 * self._count * self._inner + 1)
        self._path = [balance.arm.path(starts[:, None] + halves, order) for order in range(3)]

    def errors(self) -> Array:
        """(W, samples, p) measured less predicted."""
        p = len(self._joints)
        every = 2 * self._inner
        measured = self._path[0][:, ::every, self._joints]
        first = np.concatenate([x[:, 0, self._joints] for x in self._path[:2]], axis=1)  # (W, 2 p)
        for _ in range(_PASSES):
            nudges = np.concatenate([np.zeros((1, 2 * p)), _NUDGE * np.eye(2 * p)])
            runs = self._run(first + nudges[:, None])  # (1 + 2 p, W, samples, p)
            left = (measured - runs[0]).reshape(len(first), -1)
            slope = (runs[1:] - runs[0]).reshape(2 * p, *left.shape) / _NUDGE
            matrix = np.einsum('iwn,jwn->wij', slope, slope)
            vector = np.einsum('iwn,wn->wi', slope, left)
            change = np.linalg.solve(matrix, vector[:, :, None])[:, :, 0]
            first = first + change
            if np.max(np.abs(change)) < _SETTLED:
                break
        return np.asarray(measured - self._run(first[None])[0])

    def _run(self, first: Array) -> Array:
        """(C, W, samples, p) positions from (C, W, 2 p) first states, by RK4."""
        p = len(self._joints)
        state, out = first, [first[..., :p]]
        for k in range(self._count * self._inner):
            state = rk_step(self._rate, 2.0 * k, state, 2.0, RK4)
            if (k + 1) % self._inner == 0:
                out.append(state[..., :p])
        return np.stack(out, axis=2)

    def _rate(self, at: float, state: Array) -> Array:
        """Change of states in half a step, at half step `at`."""
        p, copies = len(self._joints), len(state)
        q, qd, qdd = (np.tile(x[:, round(at)], (copies, 1)) for x in self._path)
        flat = state.reshape(-1, 2 * p)
        q[:, self._joints], qd[:, self._joints], qdd[:, self._joints] = flat[:, :p], flat[:, p:], 0
        none = np.zeros((len(q), 3))
        here = Kinematics(np.zeros(len(q)), q, qd, none, Rotation.identity(len(q)), qdd, none)
        motion = self._process.motion(here, np.zeros_like(q))
        lacking = self._lacking(motion)
        accelerations, inertia = motion.acceleration, np.empty((len(q), p, p))
        for k, joint in enumerate(self._joints):
            accelerated = np.array(accelerations)
            accelerated[:, 6 + joint] = 1.0
            motion.acceleration = accelerated
            inertia[:, :, k] = self._lacking(motion) - lacking
        bend = -np.linalg.solve(inertia, lacking[:, :, None])[:, :, 0]
        rate = np.concatenate([flat[:, p:], bend], axis=1)
        return 0.5 * self._h * rate.reshape(state.shape)

    def _lacking(self, motion: Motion) -> Array:
        """(N, p) torque that the free joints would need for a motion beyond what effects give."""
        missing = self._process.needed(motion) - self._process.forces(motion)
        return np.asarray(missing[:, 6 + self._joints])
