"""The model watched in flight: the diagnosis' residuals block by block, alarms and their end.

docs/nodes/monitor.md tells how it decides.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...errors import MessageRejectedError
from ...estimation.torque_process import TorqueDriven
from ...identification.estimate import Estimate
from ...model.robot import Robot
from ...model.settings import MonitorSettings
from ...recording.buffer import SampleBuffer
from ...recording.mapped_inputs import INPUTS
from ...recording.record import Record
from ...types import Array
from .block_filter import FlightFilter
from .block_innovations import Block, joined
from .event_watch import EventWatch
from .monitor_state import MonitorState, channel_states, jump_in_words
from .observed import CONTEXT_NS, Observations
from .probes import probes_of
from .sequential_tests import SequentialTests
from .start import Start, learn
from .wheel_momentum import Momentum
from .window_whiteness import Whiteness

_LATENESS_NS = 100_000_000  # by which a sample may come behind newer ones
_GAP_NS = 2_000_000_000  # without joints, after which the state is found anew
_FEWEST_TO_LEARN = 50
_PART, _WATCHED = 0.25, 5  # s between looks for events, and newest parts in which one may begin
_SNAPSHOTS = 256  # blocks
_SHORT_WINDOW = 8.0  # s


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
        momentum_std: float = 1000.0,
    ) -> None:
        self.robot = robot
        self.probes = probes_of(robot)
        self._settings = settings
        self._believed = tuple(believed)
        known = settings.target_momentum == 'believed'
        self._momentum_std = 0.0 if known else momentum_std
        self._block_ns = round(settings.block * 1e9)
        self._part_ns = round(self._block_ns / math.ceil(settings.block / _PART))
        self.reset()

    def reset(self) -> None:
        """Forget everything, as at the beginning of another run."""
        options = self._settings
        self._observations = Observations(self.robot, self._believed)
        self._start: Start | None = None
        self._filter: FlightFilter | None = None
        self.begin_segment()
        self._estimate: Estimate | None = None
        self._is_told = False
        self._tests = SequentialTests(
            self.probes, options.false_alarm_interval, options.block, options.clear_after
        )
        self._momenta: deque[Momentum] = deque(maxlen=_SNAPSHOTS)
        self._trusted: Momentum | None = None
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
        self._begun_ns = self._block_begin_ns = 0
        window = self._settings.whiteness_window
        self._whiteness = Whiteness(self.probes, window, min(window, _SHORT_WINDOW))
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
        return self._tests.threshold

    def add_joints(self, stamp_ns: int, q: Array, qd: Array, effort: Array | None) -> None:
        """Take a joint sample.

        Args:
            stamp_ns: Its stamp [ns].
            q: (n,) positions [rad].
            qd: (n,) rates [rad/s].
            effort: (n,) measured motor torques [N m], or None.

        Raises:
            MessageRejectedError: wrong lengths, not finite, a second sample with its stamp, or one
                that is too late.
        """
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
        if np.any((shares < 0.0) | (shares > 1.0)):
            raise MessageRejectedError('commands to thrusters are shares from 0 to 1')
        names = tuple(thruster.name for thruster in self.robot.thrusters)
        self.samples.add_input('thrusters', names, stamp_ns, shares)

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
        if estimate.valid and self._momentum_std and not self._is_told:
            self._estimate, self._is_told = estimate, True

    def step(self, now_ns: int | None = None) -> MonitorState:
        """Judge what is complete; `now_ns` is of `SampleBuffer.settled_ns`."""
        while self._advance(now_ns):
            pass
        return self.state

    # ------------------------------------------------------------ from block to block

    def _advance(self, now_ns: int | None) -> bool:
        """Judge or skip one block; False where none is complete."""
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
        end_ns = inside[-1] if inside else ahead[0]
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
            reason = f'learning: {done:.0f} of {self._settings.learn:g} s'
            self.state = MonitorState(reason=reason)
            return False
        record = self._observe(first_ns, end_ns)
        if record is None or len(record.joint_time) < _FEWEST_TO_LEARN:
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
        self._momenta.clear()
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

    # ------------------------------------------------------------ judgement

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
                self._judge(start, flight, block, end_ns)

    def _judge(self, start: Start, flight: FlightFilter, block: Block, end_ns: int) -> None:
        known = self._known
        structure = self._whiteness.add(block, self.state.raised_ns is not None)
        verdict = self._tests.add(block, structure.evidence)
        if not verdict.is_explained:
            self._unlearn(flight, known, bool(verdict.alarmed.any()))
        before, is_alarmed = self.state, bool(verdict.alarmed.any())
        state = replace(
            before,
            judged_ns=end_ns,
            channels=channel_states(self.probes, verdict, structure, self.threshold),
            notes=start.notes,
        )
        if is_alarmed and before.raised_ns is None:
            first = verdict.speaks_first
            channel = state.channels[first]
            state = replace(
                state,
                level='error',
                reason=channel.reason
                or jump_in_words(self.probes[first], verdict.sharpest[first]),
                raised_ns=end_ns,
                first=channel.name,
                alarms=before.alarms + 1,
            )
            self._trusted = flight.momentum = self._momentum_before(first, known)
        elif not is_alarmed:
            self._trusted = None
            suspects = [c.reason for c in state.channels if c.level == 'warn']
            said = '; '.join(suspects) or 'the model explains the data'
            level = 'warn' if suspects else 'ok'
            state = replace(state, level=level, reason=said, raised_ns=None)
        self.state = self._with_momentum(state, flight)

    def _unlearn(self, flight: FlightFilter, known: Momentum, is_alarmed: bool) -> None:
        """Forget what a block taught that the model does not explain.

        A fault of a second would stay in the state for long, because no torque from outside is
        thought to change the whole's angular momentum; so the state is found anew.
        """
        flight.momentum = known if self._trusted is None else self._trusted
        if is_alarmed:
            flight.restart(is_continued=True)

    def _momentum_before(self, first: int, known: Momentum) -> Momentum:
        """What was known of the momentum before the cause of an alarm set in."""
        since = self._tests.since(first) + 1
        return self._momenta[max(0, len(self._momenta) - since)] if self._momenta else known

    def _with_momentum(self, state: MonitorState, flight: FlightFilter) -> MonitorState:
        """Keep book of the momentum."""
        momentum = flight.momentum
        self._momenta.append(momentum)
        believed = flight.process.robot.target_momentum + momentum.mean
        std = np.sqrt(np.diag(momentum.covariance))
        return replace(state, momentum=tuple(believed.tolist()), momentum_std=tuple(std.tolist()))
