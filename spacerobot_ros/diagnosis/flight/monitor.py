"""The model watched in flight: the diagnosis' residuals block by block, alarms and their end.

docs/nodes/monitor.md tells how it decides.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...errors import MessageRejectedError, SpaceRobotError
from ...estimation.filters.torque_process import TorqueDriven
from ...identification.estimate import Estimate
from ...model.robot import Robot
from ...model.settings import MonitorSettings
from ...recording.buffer import WHEELS, SampleBuffer
from ...recording.faults.thresholds import FEWEST_SAMPLES
from ...recording.messages import vector
from ...recording.record import Record
from ...recording.robot_inputs import own_wheels
from ...recording.tables.units import INPUTS
from ...types import Array
from .alarms import Alarms
from .block_filter import FlightFilter
from .block_innovations import Block, joined
from .event_watch import EventWatch
from .monitor_state import MonitorState
from .observed import CONTEXT_NS, Observations
from .probes import probes_of
from .start import Start, learn
from .wheel_momentum import Momentum

_LATENESS_NS = 100_000_000  # by which a sample may come behind newer ones
_GAP_NS = 2_000_000_000  # without joints, after which the state is found anew
_POSSIBLE = 1e3  # N m s, of wheels of which nothing is known
_NO_TORQUE = 10.0  # effort limits; neither a collision nor a current at its peak goes so far
_UNUSABLE = (SpaceRobotError, ArithmeticError, ValueError, np.linalg.LinAlgError)
_PART, _WATCHED = 0.25, 5  # s between looks for events, and newest parts in which one may begin


class Monitor:
    """Watches one robot. Give it samples, in nearly any order, and call `step` now and then.

    Args:
        robot: The robot file's robot.
        settings: Section `monitor`.
        believed: The robot file's own effects.
        momentum_std: What is thought possible of the captured wheels' momentum, each axis
            [N m s].
    """

    def __init__(
        self,
        robot: Robot,
        settings: MonitorSettings,
        believed: Sequence[Effect] = (),
        momentum_std: float = _POSSIBLE,
    ) -> None:
        self.robot = robot
        self.probes = probes_of(robot)
        self._largest_efforts = _NO_TORQUE * robot.effort_limits[: len(robot.arm)]
        self._settings = settings
        self._believed = tuple(believed)
        known = settings.target_momentum == 'believed'
        self._momentum_std = 0.0 if known else momentum_std
        self._block_ns = round(settings.block * 1e9)
        self._part_ns = round(self._block_ns / math.ceil(settings.block / _PART))
        self.reset()

    def reset(self) -> None:
        """Forget everything, as at the beginning of another run."""
        self._alarms = Alarms(self.probes, self._settings)
        self._observations = Observations(self.robot, self._believed)
        self._start: Start | None = None
        self._filter: FlightFilter | None = None
        self.begin_segment()
        self._estimate: Estimate | None = None
        self._is_believed = False
        self.events = EventWatch(self.robot, self.probes, _WATCHED)
        self.state = MonitorState()

    def begin_segment(self) -> None:
        """Take what comes now as another part of the flight, whatever its stamps.

        What was learned of noise, efforts and momentum is kept, and so is an alarm.
        """
        self._observations.begin_segment()
        self._edge_ns: int | None = None
        self._is_continued = False
        self._parts: list[Block] = []
        self._begun_ns = self._block_begin_ns = self._tried_ns = 0
        self._alarms.begin_segment()
        if self._filter is not None:
            self._filter.restart()

    @property
    def samples(self) -> SampleBuffer:
        """The newest samples."""
        return self._observations.samples

    @property
    def left_out(self) -> Counter[str]:
        """Samples that contradict their neighbours, by sensor."""
        return self._observations.left_out

    @property
    def threshold(self) -> float:
        """Sum of log likelihood ratios that raises an alarm [nats]."""
        return self._alarms.threshold

    def add_joints(self, stamp_ns: int, q: Array, qd: Array, effort: Array | None) -> None:
        """Take a joint sample.

        Args:
            stamp_ns: Its stamp [ns].
            q: (n,) positions [rad].
            qd: (n,) rates [rad/s].
            effort: (n,) measured motor torques [N m], or None.

        Raises:
            MessageRejectedError: wrong lengths, not finite, a second sample with its stamp, one
                that is too late, or efforts that no motor of the robot gives.
        """
        if effort is not None:
            sizes = np.abs(vector(effort, len(self._largest_efforts), 'effort'))
            if (sizes > self._largest_efforts).any():
                raise MessageRejectedError(f'effort is over {_NO_TORQUE:g} times its limit')
        self.samples.add_joints(stamp_ns, q, qd, effort)

    def add_rate(self, stamp_ns: int, omega: Array) -> None:
        """Take a gyro sample, (3,) omega_WB_B [rad/s]; raises as `add_joints`."""
        self.samples.add_rate(stamp_ns, omega)

    def add_attitude(self, stamp_ns: int, q_xyzw: Array) -> None:
        """Take a star tracker sample, (4,) q_WB xyzw; raises as `add_joints`."""
        self.samples.add_attitude(stamp_ns, q_xyzw)

    def add_commands(self, stamp_ns: int, shares: Array) -> None:
        """Take commands (k,) to the robot's thrusters, 0 to 1, held until the next.

        Raises:
            MessageRejectedError: wrong length, not shares, or a second one with its stamp.
        """
        names = tuple(thruster.name for thruster in self.robot.thrusters)
        bad = np.flatnonzero((shares < 0.0) | (shares > 1.0)).tolist()
        if bad:
            raise MessageRejectedError(
                f'{names[bad[0]]}: commands are shares from 0 to 1, got {shares[bad[0]]:.9g}'
            )
        self.samples.add_input('thrusters', names, stamp_ns, shares)

    def add_wheels(self, stamp_ns: int, rates: Array) -> None:
        """Take rates (k,) of the robot's own wheels, relative to the base [rad/s].

        Raises:
            MessageRejectedError: wrong length, not finite, or a second one with its stamp.
        """
        self.samples.add_input(WHEELS, own_wheels(self.robot), stamp_ns, rates)

    def add_wrench(self, stamp_ns: int, wrench: Array) -> None:
        """Take a wrench (6,) on the base at its origin, held until the next [N, N m].

        Raises:
            MessageRejectedError: wrong length, not finite, or a second one with its stamp.
        """
        self.samples.add_input('base_wrench', INPUTS['base_wrench'][0], stamp_ns, wrench)

    def believe(self, estimate: Estimate) -> None:
        """Take the first valid estimate of the captured wheels, with its covariance.

        From its stamp on the flight itself improves on it; later estimates rest on data that have
        been used by then.

        Raises:
            MessageRejectedError: it is of other links than the robot's.
        """
        links = tuple(wheels.link for wheels in self.robot.target_wheels)
        if estimate.aam_links != links:
            raise MessageRejectedError(
                f'aam is of links {list(estimate.aam_links)}, expected {list(links)}'
            )
        if estimate.valid and self._momentum_std and not self._is_believed:
            self._estimate, self._is_believed = estimate, True

    def step(self, now_ns: int | None = None) -> MonitorState:
        """Judge what is complete; `now_ns` is of `SampleBuffer.settled_ns`."""
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            while self._advance(now_ns):  # what is not finite is skipped
                pass
        return self.state

    # ------------------------------------------------------------ from block to block

    def _advance(self, now_ns: int | None) -> bool:
        """Judge or skip one block; False where none is complete."""
        try:
            return self._judge(now_ns)
        except _UNUSABLE as error:
            self._skip(self._tried_ns, f'nothing can be made of the samples: {error}')
            return True

    def _judge(self, now_ns: int | None) -> bool:
        newest, stamps = self.samples.settled_ns(now_ns), self.samples.streams['joints'].stamps
        if newest is None or not stamps:
            return False
        newest -= _LATENESS_NS
        edge_ns = stamps[0] if self._edge_ns is None else self._edge_ns
        if self._start is None or self._filter is None:
            return self._learn(edge_ns, newest)
        # alone at a beginning, a reference through a part of a block would rest on few samples
        part_ns = self._part_ns if self._is_continued else self._block_ns
        if newest - CONTEXT_NS < edge_ns + part_ns:
            return False
        ahead = [s for s in stamps if edge_ns < s <= newest - CONTEXT_NS]
        if not ahead:
            return False
        if ahead[0] - edge_ns > _GAP_NS:
            self._skip(ahead[0], 'no joint states for a while')
            return True
        inside = [s for s in ahead if s <= edge_ns + part_ns]
        if not self._parts:
            self._take_estimate(edge_ns)
        self._tried_ns = end_ns = inside[-1] if inside else ahead[0]
        if not self._is_continued:
            self._begun_ns = edge_ns
        first_ns = max(end_ns - self._block_ns - CONTEXT_NS, self._begun_ns)
        record = self._observe(first_ns, end_ns + CONTEXT_NS)
        if record is None:
            self._skip(end_ns, 'too few samples of the sensors')
            return True
        if self._observations.gap_end is not None:
            self._skip(end_ns, 'joints or gyro are silent for a while')
            return True
        self._add_part(self._start, self._filter, record, (edge_ns, end_ns))
        return True

    def _learn(self, first_ns: int, newest: int) -> bool:
        end_ns = first_ns + round(self._settings.learn * 1e9)
        if newest < end_ns + CONTEXT_NS:
            done = (newest - first_ns) * 1e-9
            reason = f'learning: {max(done, 0.0):.0f} of {self._settings.learn:g} s'
            self.state = MonitorState(reason=reason)
            return False
        self._tried_ns = end_ns
        record = self._observe(first_ns, end_ns)
        if record is None or len(record.joint_time) < FEWEST_SAMPLES:
            begun_ns = self.samples.streams['joints'].after(end_ns)
            if begun_ns is not None:
                self._skip(begun_ns, 'too few samples of the sensors to learn from')
            return begun_ns is not None
        gap_end = self._observations.gap_end
        if gap_end is not None:
            begun_ns = (self.samples.origin_ns or 0) + round(gap_end * 1e9)
            self._skip(begun_ns, 'joints or gyro are silent for a while')
            return True
        self._edge_ns = first_ns
        self._observations.has_gyro = len(record.rate_time) > 0
        self._start = learn(record, self.robot, self._believed, self._momentum_std)
        self._begin(np.eye(self.robot.target_momentum.size) * self._momentum_std**2)
        return True

    def _begin(self, momentum_covariance: Array) -> None:
        """Filter with the model and nothing known of the state."""
        start = self._start
        if start is None:
            return
        momentum = Momentum(np.zeros(len(momentum_covariance)), momentum_covariance)
        self._filter = FlightFilter(
            start.process, start.noise, start.timing, self.probes, momentum, _WATCHED
        )
        self._alarms.forget_momenta()
        self._is_continued = False

    def _take_estimate(self, edge_ns: int) -> None:
        """Believe an estimate from its stamp on."""
        estimate, start = self._estimate, self._start
        if estimate is None or start is None or edge_ns < estimate.stamp_ns:
            return
        self._estimate = None
        robot = self.robot.with_target_momentum(estimate.aam)
        self._start = replace(start, process=TorqueDriven(robot, self._believed))
        size = len(estimate.aam)
        worse = max(1.0, estimate.chi2_per_dof)
        self._begin(estimate.covariance[:size, :size] * worse)

    def _skip(self, end_ns: int, why: str) -> None:
        if self._filter is not None:
            self._filter.restart()
        self._is_continued = False
        self._parts.clear()
        self.events.interrupt()
        self._edge_ns = end_ns
        self.samples.close(end_ns - 1, CONTEXT_NS)
        if self.state.level != 'error':
            self.state = replace(self.state, level='stale', reason=why, judged_ns=end_ns)

    def _observe(self, first_ns: int, last_ns: int) -> Record | None:
        start = self._start
        robot = self.robot if start is None else start.process.robot
        noise = None if start is None else start.noise
        return self._observations.record(first_ns, last_ns, robot, noise)

    # ------------------------------------------------------------ alarms

    def _add_part(
        self, start: Start, flight: FlightFilter, record: Record, span_ns: tuple[int, int]
    ) -> None:
        """Look for events in a part of a block, and judge the block where it is complete."""
        begin_ns, end_ns = span_ns
        if not self._parts:
            self._known, self._block_begin_ns = flight.momentum, begin_ns
        begin, end = (self.samples.seconds(ns) for ns in span_ns)
        part = flight.block(record, end, not self._parts).scaled(start.spread)
        self._is_continued = True
        self._edge_ns = end_ns
        self.samples.close(end_ns, self._block_ns + 2 * CONTEXT_NS)
        self._parts.append(part)
        self.events.add(part, begin, end)
        if self.events.event is not self.state.event:
            count = self.events.count
            self.state = replace(self.state, event=self.events.event, events=count)
        if end_ns - self._block_begin_ns > self._block_ns - self._part_ns // 2:
            block = joined(self._parts)
            self._parts.clear()
            if len(block.data):
                state = replace(self.state, judged_ns=end_ns, notes=start.notes)
                self.state = self._alarms.of(block, flight, self._known, state)
