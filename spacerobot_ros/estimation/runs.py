"""One record and one robot: what all hypotheses about them share, and their rows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..effects.effect import Effect
from ..model.robot import Robot
from ..recording.record import Record
from ..recording.robot_inputs import with_inputs
from ..sensing.reading_gains import Readings, moved_by_torque, reading_gains
from ..sensing.sensor_faults import corrected_record
from ..types import Array
from .filters.measured_torque import TIMINGS
from .filters.prediction import MeasuredMotion
from .filters.prediction_rows import PredictionRows
from .filters.torque_process import TorqueDriven
from .rows import Rows
from .trajectory.reference import NoiseLevels
from .trajectory.splines import Samples, fit_spline


class Run:
    """What is the same for every model of a record; its rows are made by prediction.

    Args:
        record: As measured.
        robot: The robot file's robot.
        believed: Its own effects.
        noise: Noise levels.
        timing: How efforts act, a key of `measured_torque.TIMINGS`.
        left_out: Starts and ends of times [s] in which anything may act from outside.
    """

    def __init__(
        self,
        record: Record,
        robot: Robot,
        believed: Sequence[Effect],
        noise: NoiseLevels,
        timing: str = 'sampled',
        left_out: tuple[tuple[float, float], ...] = (),
    ) -> None:
        self.record = record
        self.robot = with_inputs(robot, record)
        self.believed = tuple(believed)
        self.noise = noise
        self.timing = timing
        self.left_out = left_out

    def without(self, left_out: tuple[tuple[float, float], ...]) -> Run:
        """The same run, times left out."""
        return Run(self.record, self.robot, self.believed, self.noise, self.timing, left_out)

    def timed(self, timing: str) -> Run:
        """The same run, its efforts acting in another way."""
        other = Run(self.record, self.robot, self.believed, self.noise, timing, self.left_out)
        if not any(effect.acts('delay') for effect in self.believed):
            other.__dict__['_believed_motion'] = self._believed_motion
        return other

    def rows(self, causes: Sequence[Effect]) -> Rows:
        """Rows of the robot with its own effects and some causes."""
        return PredictionRows(*self._modelled(causes), self.timing)

    def _modelled(self, causes: Sequence[Effect]) -> tuple[MeasuredMotion, TorqueDriven]:
        """The record, the robot's own sensor effects and those of some causes undone; a model."""
        process = TorqueDriven(self.robot, (*self.believed, *causes))
        if any(cause.acts(a) for cause in causes for a in ('sense', 'delay', 'joint_delays')):
            return self._misread(causes, process), process
        return self._believed_motion, process

    def _misread(self, causes: Sequence[Effect], process: TorqueDriven) -> MeasuredMotion:
        """The record with sensor effects of causes undone, which leaves what swings as it is."""
        motion, believed = self._motion(causes, process), self._believed_motion
        if np.array_equal(motion.time_base.times, believed.time_base.times):
            motion.swung = believed.swung
        return motion

    @cached_property
    def _believed_motion(self) -> MeasuredMotion:
        return self._motion((), TorqueDriven(self.robot, self.believed))

    def _motion(self, causes: Sequence[Effect], process: TorqueDriven) -> MeasuredMotion:
        effects = (*self.believed, *causes)
        is_held = TIMINGS[self.timing] is not None
        if not any(effect.acts('sense') for effect in effects):
            record = corrected_record(self.record, process.robot, effects, is_held)
            return MeasuredMotion(record, self.noise, process, self.left_out)
        rough, alike = self._effort_noise
        record = corrected_record(self.record, process.robot, effects, is_held, rough)
        gains = reading_gains(record, process.robot, effects)
        level = self.noise.joint_effort
        unsure = moved_by_torque(record, process.robot, effects, rough, level)
        readings = Readings(gains, unsure, alike)
        return MeasuredMotion(record, self.noise, process, self.left_out, readings)

    @cached_property
    def _effort_noise(self) -> tuple[Array | float, float]:
        """(N, n) measured efforts less a smooth torque [N m], and `Readings.alike` of that torque.

        The torque's errors have a share of the efforts' variance, number of coefficients by number
        of samples, but are alike over as many samples as one such share: on a mean they weigh as
        errors of that whole variance that are not alike.
        """
        effort, time = self.record.effort, self.record.joint_time
        if effort is None:
            return 0.0, 1.0
        samples = Samples(time, effort, self.noise.joint_effort)
        torque = fit_spline([samples], time[0], time[-1])
        return effort - torque(time), max(len(time) / len(torque.curve.c), 1.0)
