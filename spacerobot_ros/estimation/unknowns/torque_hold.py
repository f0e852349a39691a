r"""What holding torques over a control period does to sampled rates.

Motors hold their torque over a period T, so the acceleration is smooth only in the mean. Its part
that the torques make, M a = [0; tau], stays behind a ramp of slope j = M^-1 [0; tau'] and catches
up at the period's end. At the fraction p of a hold, against the smooth rate that angles and
attitudes integrate,

    rate(p) - smooth(p) = -T^2/2 B2(p) j          B2(p) = p^2 - p + 1/6

(B2: Bernoulli polynomial; its mean is zero, so angles stay within 0.01 T^3 j and need nothing).
Rates sampled where holds meet lie k j with k = T^2/12 below, some 1e-5 rad/s at T = 10 ms, which
ignored moves the estimate by two standard deviations. j follows from the reference and the
present constants; no torque sensor is needed. It is not the second derivative of the rates, in
which gyroscopic torques share that no motor holds.

Symbols: N times, n joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ...dynamics.crba import crba
from ...dynamics.equations import joint_torques, without_translation
from ...dynamics.forward_kinematics import forward_kinematics
from ...dynamics.tree import tree_of
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..trajectory.reference import ReferenceTrajectory

_SAMPLES_A_KNOT = 3  # of the torque, between knots of the reference
_KNOWN_TO = 0.1  # of k; what torques lag behind their stamps moves it
_STEPS = (0.01, 0.1)  # s; shortest and longest step between the torque's samples


@dataclass(frozen=True, slots=True, eq=False)
class Holds:
    """When torques are set, as far as the data or the settings say.

    Args:
        starts: (m,) increasing times at which torques were set [s].
        period: Time over which each is held [s].
        is_known: Whether that period is known; otherwise it is a guess that gives phases only.
    """

    starts: Array
    period: float
    is_known: bool

    def shape(self, time: Array) -> Array:
        """(N,) 6 B2(p): one where holds meet, -1/2 in their middle, zero where unknown."""
        if self.period <= 0.0 or not len(self.starts):
            return np.zeros(len(time))
        index = np.maximum(np.searchsorted(self.starts, time, side='right') - 1, 0)
        p = np.mod((time - self.starts[index]) / self.period, 1.0)
        return np.asarray(6.0 * (p * p - p) + 1.0)

    def prior(self) -> tuple[float, float] | None:
        """Mean and standard deviation of k [s^2]; None where the period is not known."""
        k = self.period**2 / 12.0
        return (k, _KNOWN_TO * k) if self.is_known else None


def find_holds(record: Record, period: float, first: float | None = None) -> Holds:
    """Holds of a stretch of data.

    A stated period counts from the first joint sample. Efforts that stay the same to the last bit
    over several samples show their holds. Otherwise holds are taken to meet at the joint samples,
    which controllers answer, and how long they really are is left to the estimate.

    Args:
        record: Joint samples; an effort is the torque over the step that ended at its time.
        period: As stated; zero where it is not [s].
        first: First joint sample of the run, where the record begins later [s].
    """
    time, effort = record.joint_time, record.effort
    if period > 0.0 and len(time):
        start = float(time[0]) if first is None else first
        count = int((time[-1] - start) / period) + 1
        starts = np.asarray(start + period * np.arange(count), dtype=float)
        return Holds(starts, period, is_known=True)
    if effort is not None:
        changes = np.flatnonzero(np.any(np.diff(effort, axis=0) != 0.0, axis=1))
        if len(changes) > 2 and np.median(np.diff(changes)) >= 2.0:
            starts = record.effort_time[changes]
            return Holds(starts, float(np.median(np.diff(starts))), is_known=True)
    guess = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return Holds(time, guess, is_known=False)


def held_jerk(robot: Robot, trajectory: ReferenceTrajectory) -> scipy.interpolate.CubicSpline:
    """(3 + n) jerk M^-1 [0; tau'] that held torques make of [omega_WB_B; q'], over time.

    Args:
        robot: The robot, its captured wheels included.
        trajectory: The motion.
    """
    time = trajectory.times
    joints, rate = trajectory.joints, trajectory.rate
    spacing = min(joints.spacing, rate.spacing) / _SAMPLES_A_KNOT
    count = int((time[-1] - time[0]) / float(np.clip(spacing, *_STEPS)))
    dense = np.linspace(time[0], time[-1], max(count, 4) + 1)
    q = np.ascontiguousarray(joints(dense))
    tau = joint_torques(robot, q, joints(dense, 1), joints(dense, 2), rate(dense))
    slope = np.zeros((len(dense), 3 + q.shape[1]))
    slope[:, 3:] = scipy.interpolate.CubicSpline(dense, tau)(dense, 1)
    tree = tree_of(robot)
    still = forward_kinematics(tree, q, np.zeros((len(q), 6 + q.shape[1])), q)
    inertia = without_translation(crba(tree, still))
    jerk = np.linalg.solve(inertia, slope[..., None])[..., 0]
    return scipy.interpolate.CubicSpline(dense, jerk)
