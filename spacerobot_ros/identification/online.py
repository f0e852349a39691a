"""The identifier's core: asynchronous samples in, estimates out, in bounded memory.

Samples are collected a sensor at a time, late ones put in their place as long as their stretch is
not solved: anything up to `identifier.lateness` behind the newest joint and gyro samples. Each
`solve` smooths the newest stretch (with some context before and a lag behind it, because a spline
is worst at its ends), runs the momentum filter over it and continues the square-root information.
While the whole run fits into the buffer it is run through again each time its length has doubled,
about the better constants; later stretches are linearised about constants that no longer move.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import MessageRejectedError
from ..estimation.minimal import minimal_set
from ..estimation.momentum_filter import MomentumFilter, Noise
from ..estimation.momentum_process import MomentumModel
from ..estimation.smoothing import SensorData, smooth, time_grid
from ..estimation.time_base import LONGEST_GAP
from ..estimation.torque_hold import find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.buffer import SampleBuffer
from ..recording.faults.kinematics import contradictions
from ..types import Array
from .estimate import Estimate
from .manifold import on_bodies
from .maximum_likelihood import Stretch, estimate_constants, prepare, run_stretch
from .noise import noise_levels
from .prior import Prior, weak_prior
from .summary import summarize

_LAG = 0.5  # s of data kept back at least, where the spline is not settled yet
_CONTEXT = 2.0  # s of data before a new stretch that its spline also fits
_MOVED = 3.0  # sigmas of shift that ask for a new run through the buffer
_FIRST = 4.0  # s of data before the first solution
_WORDS = {'joints': 'joint states', 'imu': 'gyro', 'attitude': 'attitude'}


class OnlineIdentifier:
    """Recursive estimate of wheel momentum and minimal parameters.

    Args:
        robot: What the robot file believes.
        settings: The identifier's settings.

    Raises:
        ConfigurationError: fixed base or prismatic joints.
    """

    def __init__(self, robot: Robot, settings: IdentifierSettings) -> None:
        self._settings = settings
        self._lag = max(_LAG, settings.lateness)
        self._model = MomentumModel(
            robot, minimal_set(robot, settings.structure), settings.nuisances
        )
        self.reset()

    def reset(self) -> None:
        """Forget everything that was measured."""
        self.rejected = 0
        joints = self._model.robot.joints[: self._model.n]
        self.samples = SampleBuffer(joints, self._lag, LONGEST_GAP)
        self._first_joints_ns: int | None = None  # from which holds count
        self._levels: dict[str, float] = {}
        self._notes: tuple[str, ...] = ()
        self._engine: MomentumFilter | None = None
        self._prior: Prior | None = None
        self._constants = self._model.prior()
        self._done = 0.0
        self._next_rerun = 0.0
        self._is_converged = False
        self._rerun_constants, self._rerun_std = self._constants, np.zeros(self._model.size)
        self._used = 0
        self._faults: tuple[str, ...] = ()
        self._bodies: Array | None = None  # where the next search for bodies starts
        self._last: Estimate | None = None

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> None:
        """Add a joint sample: q (n,) [rad], qd (n,) [rad/s].

        Raises:
            MessageRejectedError: not finite, wrong length, a stamp seen before, one so late that
                its stretch is solved, or one far ahead of all others; the sample is not used.
        """
        with self._counting():
            self.samples.add_joints(stamp_ns, q, qd)

    def add_rate(self, stamp_ns: int, omega_WB_B: Array) -> None:
        """Add a gyro sample omega_WB_B (3,) [rad/s]; raises as `add_joints`."""
        with self._counting():
            self.samples.add_rate(stamp_ns, omega_WB_B)

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Array) -> None:
        """Add an attitude (4,); raises as `add_joints`, also for a norm off by more than 1e-3."""
        with self._counting():
            self.samples.add_attitude(stamp_ns, q_WB_xyzw)

    def solve(self, until_ns: int | None = None) -> Estimate:
        """Use all settled samples; it says why it isn't valid while they don't suffice.

        Args:
            until_ns: Last stamp to look at [ns]; None: the newest. What came later by the order
                of arrival then makes no difference.
        """
        data = self._data(until_ns)
        end = self._settled(data)
        if data is None or end - self._done < 1e-3 or (self._engine is None and end < _FIRST):
            return self._last or self._nothing(self._missing(data))
        if self._engine is None or (end <= self._settings.buffer and self._is_rerun_due(end)):
            self._run_all(data.between(-np.inf, end), end)
        else:
            self._run_new(data, end)
        self._forget(end)
        self._last = self._summary(end)
        return self._last

    @contextmanager
    def _counting(self) -> Iterator[None]:
        """Count what is rejected."""
        try:
            yield
        except MessageRejectedError:
            self.rejected += 1
            raise

    def _data(self, until_ns: int | None) -> SensorData | None:
        """The samples; None while a sensor is missing."""
        r = self.samples.record(None, until_ns)
        if r.joints is None or r.rates is None or r.attitudes is None:
            return None
        if self._first_joints_ns is None:
            self._first_joints_ns = int(r.joints.stamp_ns[0])
        first, period = (
            self.samples.seconds(self._first_joints_ns),
            self._settings.torque_hold_period,
        )
        since_first = np.concatenate([[first], r.joint_time])
        holds = find_holds(since_first if period > 0.0 else r.joint_time, None, period)
        qd = np.zeros((0, self._model.n)) if r.qd is None else r.qd
        return SensorData(
            r.joint_time, r.q, qd, r.rate_time, r.omega, r.attitude_time, r.attitude_xyzw, holds
        )

    def _settled(self, data: SensorData | None) -> float:
        if data is None:
            return 0.0
        return float(min(data.joint_time[-1], data.rate_time[-1])) - self._lag

    def _run_all(self, data: SensorData, end: float) -> None:
        self._levels, self._notes = noise_levels(self._model.robot.sensors, data)
        stretch = prepare(data, self._levels)
        if self._prior is None:
            self._prior = weak_prior(self._model, stretch.reference, self._settings, data.holds)
        self._constants, self._engine, self._is_converged = estimate_constants(
            self._model, stretch, self._prior, None if self._engine is None else self._constants
        )
        self._rerun_constants = self._constants
        self._rerun_std = np.sqrt(np.diag(self._engine.information.solve()[1]))
        self._faults = contradictions(self.samples.record())
        self._continue(stretch)
        self._next_rerun = 2.0 * end
        self._used = len(data.joint_time)

    def _run_new(self, data: SensorData, end: float) -> None:
        engine, prior = self._engine, self._prior
        if engine is None or engine.last is None or prior is None:
            return
        context = data.between(self._done - _CONTEXT, np.inf)
        new = data.between(self._done, end)
        if not len(new.joint_time) and not len(new.rate_time):
            return
        stds = (
            self._levels['joint_position_std'],
            self._levels['joint_velocity_std'],
            self._levels['gyro_std'],
        )
        smoothed = smooth(
            context, min(context.joint_time[0], self._done), max(end, context.joint_time[-1]), stds
        )
        times = np.concatenate([[self._done], time_grid(new)])
        whole = smoothed.reference(times, engine.last[0].rotation[0])
        reference = whole.part(slice(1, None))
        engine.noise = Noise(*stds, self._levels['attitude_std'], smoothed.snap_density(times))
        stretch = Stretch(new, reference, engine.noise, smoothed)
        run_stretch(engine, self._model, stretch, self._constants)
        change, _ = engine.information.solve()
        proposed = prior.admissible(
            self._model, reference, self._constants, self._constants + change
        )
        engine.shift_constants(proposed - self._constants)
        self._constants = proposed
        self._continue(stretch)
        self._used += len(new.joint_time)

    def _is_rerun_due(self, end: float) -> bool:
        """Whether the linearisation of what was run through is no longer good enough."""
        if not self._is_converged or end >= self._next_rerun:
            return True
        return bool(
            np.any(np.abs(self._constants - self._rerun_constants) > _MOVED * self._rerun_std)
        )

    def _continue(self, stretch: Stretch) -> None:
        """Fold the attitude error into the reference: the next stretch starts from there."""
        engine = self._engine
        if engine is None or engine.last is None:
            return
        last, model = engine.last
        correction = Rotation.from_rotvec(engine.take_attitude())
        engine.last = (replace(last, rotation=last.rotation * correction), model)
        self._done = float(stretch.reference.time[-1])

    def _forget(self, end: float) -> None:
        whole = end <= self._settings.buffer
        keep = self._settings.buffer if whole else _CONTEXT + self._lag
        self.samples.close(self._stamp(self._done), round(keep * 1e9))

    def _stamp(self, seconds: float) -> int:
        return (self.samples.origin_ns or 0) + round(seconds * 1e9)

    def _summary(self, end: float) -> Estimate:
        engine, prior = self._engine, self._prior
        if engine is None or prior is None:
            return self._nothing('nothing solved yet')
        # The information's own solution is the best estimate, also where the point of
        # linearisation was held back.
        change, _ = engine.information.solve()
        stamp = self._stamp(self._done)
        estimate = summarize(
            'online',
            self._model,
            self._settings,
            self._constants + change,
            engine.information,
            prior,
            self._used,
            stamp,
            self._notes,
            engine.placebo,
        )
        if estimate.valid and not self._is_converged:
            estimate = replace(
                estimate,
                valid=False,
                reason='the estimate still moves when the data are run through again',
            )
        if self._faults:
            return replace(estimate, valid=False, reason='; '.join(self._faults))
        estimate, bodies = on_bodies(
            self._model,
            self._settings,
            estimate,
            self._constants + change,
            engine.information.factor[:, :-1],
            self._bodies,
        )
        if bodies is not None:
            self._bodies = bodies.coordinates
        return estimate

    def _missing(self, data: SensorData | None) -> str:
        missing = [_WORDS[sensor] for sensor in _WORDS if sensor in self.samples.missing]
        if missing:
            return f'no {" and no ".join(missing)} yet'
        return f'only {max(self._settled(data), 0.0):.1f} s of data yet, {_FIRST:g} s are needed'

    def _nothing(self, reason: str) -> Estimate:
        """The prior as an estimate that is not valid."""
        model, settings = self._model, self._settings
        prior = model.prior()
        std = np.concatenate(
            [
                np.full(model.n_aam, settings.momentum_prior_std),
                np.full(
                    len(model.minimal),
                    settings.prior_std * np.max(np.abs(prior[model.x])),
                ),
            ]
        )
        return Estimate(
            method='online',
            valid=False,
            reason=reason,
            aam_links=tuple(g.link for g in model.robot.target_wheels),
            aam=prior[model.aam],
            parameter_names=model.minimal.names,
            parameters=prior[model.x],
            covariance=np.diag(std**2),
            rank=0,
            condition=float('inf'),
            unexcited=('every direction',),
            total_momentum=np.zeros(3),
            total_momentum_covariance=np.eye(3) * (10.0 * settings.momentum_prior_std) ** 2,
            chi2_per_dof=0.0,
            samples=0,
            stamp_ns=self.samples.newest_ns or 0,
        )
