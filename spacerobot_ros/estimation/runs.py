"""One record and one robot: what all hypotheses about them share, and their rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..effects.effect import Effect
from ..model.robot import Robot
from ..recording.record import Record
from ..sensing.correction import corrected_record
from ..types import Array
from .balance import Balance, band_limited
from .columns import Signatures, candidates
from .prediction import MeasuredMotion
from .prediction_rows import PredictionRows
from .reference import NoiseLevels, ReferenceTrajectory
from .rows import Rows
from .torque_process import TorqueDriven

_LEAST_ANGLE = 1e-5  # rad; few encoders are as good


class Run:
    """What is the same for every model of a record; its rows are made by prediction.

    Args:
        record: As measured.
        robot: The robot file's robot.
        believed: Its own effects.
        noise: Noise levels.
        timing: How efforts act, a key of `prediction.TIMINGS`.

    Attributes:
        is_linear: Whether columns hold for effects of any size, so that several causes may be
            chosen before the model is fitted again.
        companions: Ids of effects that stand beside every hypothesis.
    """

    is_linear = False
    companions: tuple[str, ...] = ()

    def __init__(
        self,
        record: Record,
        robot: Robot,
        believed: Sequence[Effect],
        noise: NoiseLevels,
        timing: str = 'sampled',
    ) -> None:
        self.record = record
        self.robot = robot
        self.believed = tuple(believed)
        self.noise = noise
        self.timing = timing
        self._models = [0]

    @property
    def models(self) -> int:
        """Number of models whose rows were made, those of another timing among them."""
        return self._models[0]

    def timed(self, timing: str) -> Run:
        """The same run, its efforts acting in another way."""
        other = Run(self.record, self.robot, self.believed, self.noise, timing)
        other.__dict__['_believed_motion'] = self._believed_motion
        other._models = self._models
        return other

    def rows(self, causes: Sequence[Effect]) -> Rows:
        """Rows of the robot with its own effects and some causes."""
        self._models[0] += 1
        return PredictionRows(*self._modelled(causes), self.timing)

    def _modelled(self, causes: Sequence[Effect]) -> tuple[MeasuredMotion, TorqueDriven]:
        """The record, the robot's own sensor effects and those of some causes undone; a model."""
        process = TorqueDriven(self.robot, (*self.believed, *causes))
        if any(cause.acts('sense') or cause.acts('delay') for cause in causes):
            return self._motion(causes, process), process
        return self._believed_motion, process

    @cached_property
    def _believed_motion(self) -> MeasuredMotion:
        return self._motion((), TorqueDriven(self.robot, self.believed))

    def _motion(self, causes: Sequence[Effect], process: TorqueDriven) -> MeasuredMotion:
        effects = (*self.believed, *causes)
        record = corrected_record(self.record, process.robot, effects)
        return MeasuredMotion(record, self.noise, process)


class BalanceRun(Run):
    """A run whose rows are made by balance, its leftover's level found once.

    Rates are no surer than positions allow, and positions no surer than encoders are: rates are
    often made of positions by a filter, smooth and late.

    Args:
        run: The run, with efforts, of a robot on a fixed base.
        kinds: The catalogue, whose whole leaves the level.
    """

    is_linear = True
    companions = ('inertial_parameters',)

    def __init__(self, run: Run, kinds: Sequence[type[Effect]]) -> None:
        super().__init__(
            run.record, run.robot, run.believed, _settled(run.record, run.noise), run.timing
        )
        self._kinds = kinds

    def rows(self, causes: Sequence[Effect]) -> Balance:
        """See `Run.rows`."""
        self._models[0] += 1
        return Balance(*self._modelled(causes), self._levels)

    def unscaled(self, causes: Sequence[Effect]) -> Balance:
        """The same before any level is known."""
        return Balance(*self._modelled(causes))

    @cached_property
    def _levels(self) -> Array:
        """(n,) rms of what the whole catalogue leaves of every joint's torque [N m]."""
        null = self.unscaled(())
        pool = candidates([kind for kind in self._kinds if not kind.hidden], null)
        columns = Signatures(null).whitened([step for c in pool for step in c.small_steps])
        return null.levels_left_by(columns, np.concatenate([c.sizes for c in pool]))


def _settled(record: Record, noise: NoiseLevels) -> NoiseLevels:
    noise = replace(noise, joint_position=max(noise.joint_position, _LEAST_ANGLE))
    if record.joints is None or record.qd is None:
        return noise
    alone = replace(record, joints=replace(record.joints, velocity=None))
    positions = ReferenceTrajectory(alone, noise, record.joint_time)
    missed = record.qd - positions.at(record.joint_time).qd
    level = np.mean(band_limited(missed, record.joint_time) ** 2, axis=0)
    rate = max(noise.joint_velocity, float(np.sqrt(np.max(level))))
    return replace(noise, joint_velocity=rate)
