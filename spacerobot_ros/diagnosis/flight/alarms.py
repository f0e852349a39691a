"""What the newest block of a flight says of the model: alarms, their end, and what it teaches."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...model.settings import MonitorSettings
from .block_filter import FlightFilter
from .block_innovations import Block
from .monitor_state import MonitorState, channel_states
from .probes import Probe
from .sequential_tests import SequentialTests
from .wheel_momentum import Momentum
from .window_whiteness import Whiteness

_SNAPSHOTS = 256  # blocks
_SHORT_WINDOW = 8.0  # s


class Alarms:
    """Tests of every channel, and what was known of the momentum before one spoke.

    Args:
        probes: Ways in which the model may fail.
        settings: Section `monitor`.
    """

    def __init__(self, probes: Sequence[Probe], settings: MonitorSettings) -> None:
        self._probes, self._window = probes, settings.whiteness_window
        self._tests = SequentialTests(
            probes, settings.false_alarm_interval, settings.block, settings.clear_after
        )
        self._momenta: deque[Momentum] = deque(maxlen=_SNAPSHOTS)
        self._trusted: Momentum | None = None
        self.begin_segment()

    def begin_segment(self) -> None:
        """What comes now is another part of the flight; an alarm stays."""
        short = min(self._window, _SHORT_WINDOW)
        self._whiteness = Whiteness(self._probes, self._window, short)

    def forget_momenta(self) -> None:
        """The momentum is told anew."""
        self._momenta.clear()

    @property
    def threshold(self) -> float:
        """Sum of log likelihood ratios that raises an alarm [nats]."""
        return self._tests.threshold

    def of(
        self, block: Block, flight: FlightFilter, known: Momentum, state: MonitorState
    ) -> MonitorState:
        """The state after a block, whose lesson the filter loses where it is not explained.

        Args:
            block: The newest, judged for the first time.
            flight: The filter that it went through.
            known: What was known of the momentum before it.
            state: The state before it, with its end as `judged_ns`.
        """
        structure = self._whiteness.add(block, state.raised_ns is not None)
        verdict = self._tests.add(block, structure.evidence)
        is_alarmed = bool(verdict.alarmed.any())
        if not verdict.is_explained:
            self._unlearn(flight, known, is_alarmed)
        channels = channel_states(self._probes, verdict, structure, self.threshold)
        state = replace(state, channels=channels)
        if is_alarmed and state.raised_ns is None:
            first = verdict.speaks_first
            channel = channels[first]
            jump = f'{channel.name}: a jump of {verdict.sharpest[first]:.2g} times its noise'
            state = replace(
                state,
                level='error',
                reason=channel.reason or jump,
                raised_ns=state.judged_ns,
                first=channel.name,
                alarms=state.alarms + 1,
            )
            self._trusted = flight.momentum = self._momentum_before(first, known)
        elif not is_alarmed:
            self._trusted = None
            suspects = [c.reason for c in channels if c.level == 'warn']
            reason = '; '.join(suspects) or 'the model explains the data'
            level = 'warn' if suspects else 'ok'
            state = replace(state, level=level, reason=reason, raised_ns=None)
        return self._with_momentum(state, flight)

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
