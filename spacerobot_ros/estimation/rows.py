"""What a way to make rows gives to the engine: whitened residuals, and whitened columns.

Three ways exist: `prediction` (an error-state filter under the measured torques: free flight and
simulation, white sensor noise), `balance` (torques along the smoothed motion: real arms, whose
leftover is coloured, `leftover`) and `pose_rows` (windows of a lone body's pose). Columns,
evidence and placebos know no more than this.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from ..effects.motion import Motion
from ..model.robot import Robot
from ..types import Array
from .trajectory.reference import Kinematics


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelFit:
    """How white one axis of a channel is.

    Args:
        channel: Name, such as `gyro`. axis: Joint or axis number.
        spread: Standard deviation of the whitened innovations; 1 is as expected.
        p_value: Smallest of its questions, for their number.
        question: Which one: `slow` or `line`.
        frequency: Of the highest spectral line [Hz].
        line_p: Probability of a line so high.
    """

    channel: str
    axis: int
    spread: float
    p_value: float
    question: str
    frequency: float
    line_p: float


@dataclass(frozen=True, slots=True, eq=False)
class ChannelError:
    """What one model leaves of one channel along the record.

    Args:
        channel: Such as `joint_torque/joint_2` or `gyro/x`. unit: SI.
        time: (M,) [s].
        measured: (M,) measured value; empty where the channel is no sensor's.
        error: (M,) measured less predicted.
        noise_floor: Standard deviation that a right model has.
    """

    channel: str
    unit: str
    time: Array
    measured: Array
    error: Array
    noise_floor: float


class MotionModel(Protocol):
    """A motion along which columns are made."""

    @property
    def robot(self) -> Robot:
        """The robot as the model's effects make it."""
        ...

    @property
    def motion(self) -> Motion:
        """(N states) along which generalized forces are judged."""
        ...

    @property
    def is_held(self) -> bool:
        """Whether torques are held between stamps, so that late joint states make none later."""
        ...

    @property
    def effort_rate(self) -> Array:
        """(N, n) time derivative of the measured torques there [N m/s]."""
        ...

    def samples(self) -> Mapping[str, tuple[Kinematics, Motion]]:
        """The reference at the samples of every channel that a sensor's fault shows in."""
        ...

    def whitened(self, forces: Array, measured: Mapping[str, Array]) -> Array:
        """(R, K) what each column leaves in the data of a model without it.

        Args:
            forces: (N, 6 + n, K) generalized forces that the truth has and the model has not.
            measured: Channel to (samples, width, K) by which it reads more than the truth.
        """
        ...


class Rows(MotionModel, Protocol):
    """R rows of one model of one record."""

    @property
    def data(self) -> Array:
        """(R,) whitened residuals: white and of unit variance under a right model."""
        ...

    @property
    def spread_cost(self) -> float:
        """Twice what readings less sure than their noise take from the log density of the data."""
        ...

    @property
    def row_times(self) -> Array:
        """(R,) time of every row [s], not decreasing."""
        ...

    def force_correlation(self, weights: Array) -> Array:
        """(N, 6 + n) whose product with a force is `weights` times its whitened column."""
        ...

    def whiteness(self) -> tuple[float | None, tuple[ChannelFit, ...]]:
        """Probability that a right model fits as badly (None: not tested), and each channel's."""
        ...

    def channels(self) -> tuple[ChannelError, ...]:
        """Every channel along the record."""
        ...
