"""Identifier node: samples in, wheel momentum and minimal parameters with covariance out.

See docs/nodes/identifier.md.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from spacerobot_msgs.msg import Estimate as EstimateMessage

from ..effects.catalogue import believed_effects, changed_robot
from ..errors import IdentificationError
from ..estimation.trajectory.time_base import LONGEST_GAP
from ..identification.estimate import Estimate
from ..identification.online import OnlineIdentifier
from ..identification.saved_knowledge import Knowledge, load, save
from ..model.robot import Robot
from ..recording.buffer import SENSORS
from ..ros import convert
from ..ros.convert import compose
from ..ros.diagnostics import OK, STALE, WARN, Status
from ..ros.qos import LATCHED, SAMPLES
from ..sensing.sensor_faults import SensorFaults
from .beside import STOP, Beside
from .kept_file import KeptFile
from .sensor_node import SensorNode, outliers

DISORDER_NS = 50_000_000  # by which messages of one sensor overtake each other
ANSWER = 0.05  # s that a service waits for a solution; it shall answer within 0.1 s


class IdentifierNode(SensorNode):
    """Feeds the online identifier, solves at regular stamps and publishes its estimates.

    It solves on a thread of its own, in lockstep at once, so that runs repeat to the last bit.
    """

    identifier: OnlineIdentifier
    bridged_ns = LONGEST_GAP * 1e9

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('identifier', **node_kwargs)
        self.estimate: Estimate | None = None
        self._period_ns = round(self.settings.identifier.solve_period * 1e9)
        self._publisher = self.create_publisher(EstimateMessage, '/estimate', LATCHED)
        self._momenta = self.create_publisher(Vector3Stamped, '/momentum', LATCHED)
        self.offer('~/reset', self._on_reset)
        self.offer('~/solve', self._on_solve)
        self._next_ns: int | None = None
        self._beside = Beside(self, is_threaded=not self.settings.simulator.lockstep)
        self._clear()
        self.find_robot()

    def destroy_node(self) -> None:
        """Let a solution that is under way end, then leave."""
        if self.is_open:
            self.identifier.abandon()
            self._beside.end(STOP)
            self._file.close()
        super().destroy_node()

    def restart(self, why: str) -> None:
        """Forget all samples, and say so in an estimate that is not valid."""
        self._clear()
        if not self.is_open:
            return
        self._replace(OnlineIdentifier.reset)
        self.get_logger().info(f'reset: {why}')
        self._publish(self.identifier.solve())

    def begin_segment(self, why: str, jump_ns: int | None) -> None:
        """Keep what is known of the robot; all else may be another in another time."""
        self.get_logger().info(f'{why}: another segment begins')
        self._next_ns = None
        self._replace(OnlineIdentifier.begin_segment)
        self._publish(self.identifier.solve())

    def solve(self, until_ns: int | None = None) -> None:
        """Use what has arrived and publish the estimate.

        Args:
            until_ns: Last stamp to look at [ns]; None: the newest.
        """
        if self.is_open:
            identifier = self.identifier
            work = partial(self._attempt, identifier, until_ns)
            self._beside.start(work, partial(self._conclude, identifier))

    def _attempt(self, identifier: OnlineIdentifier, until_ns: int | None) -> tuple[Any, ...]:
        """Estimate and time to solve [ms], or why there is none; on whatever thread."""
        started = self.wall_ns()
        try:
            estimate = identifier.solve(until_ns)
        except IdentificationError as error:
            return None, str(error)
        return estimate, (self.wall_ns() - started) * 1e-6

    def _conclude(self, identifier: OnlineIdentifier, outcome: tuple[Any, ...]) -> None:
        if identifier is not self.identifier:
            return  # of a run that was left meanwhile
        estimate, detail = outcome
        self._failure = '' if estimate else detail
        if estimate is None:
            self.get_logger().warning(f'no estimate: {detail}', throttle_duration_sec=5.0)
            return
        self._solve_ms = detail
        self._publish(estimate)
        self._file.keep()

    def _replace(self, change: Callable[[OnlineIdentifier], None]) -> None:
        """Change the identifier; a solution that is under way goes on with another, unheard."""
        changed = self.identifier.copy()
        change(changed)
        self.identifier.abandon()
        self.identifier = changed

    def on_robot(self, robot: Robot) -> None:
        """Start to identify."""
        effects = believed_effects(self.settings, robot)
        self._faults = SensorFaults(robot, effects)
        self.identifier = OnlineIdentifier(changed_robot(robot, effects), self.settings.identifier)
        self.is_open = True
        self.follow(robot, SENSORS, SAMPLES)
        self._file = KeptFile(
            self,
            self.settings.identifier.save_file,
            lambda: self.identifier.knowledge,
            save,
            partial(load, model=self.identifier.model),
            self._go_on,
        )
        self.health.watch(self.input_status, self._estimate_status)

    def take(self, sensor: str, stamp_ns: int, *content: Any) -> None:
        """Add a sample as a sensor without the believed faults would have given it."""
        if not self.is_active:
            return
        identifier, faults = self.identifier, self._faults
        stamp_ns -= round(faults.delay[sensor] * 1e9)
        if sensor == 'joints':
            q, qd = content
            identifier.add_joints(stamp_ns, *faults.undo_joints(q, qd, np.zeros_like(q))[:2])
        elif sensor == 'imu':
            identifier.add_rate(stamp_ns, faults.undo_rate(*content))
        else:
            identifier.add_attitude(stamp_ns, faults.undo_attitude(*content))
        settled_ns = identifier.samples.settled_ns(self.wall_ns())
        if settled_ns is not None:
            self._solve_up_to(settled_ns - DISORDER_NS)

    def flush(self) -> None:
        """Solve as if all sensors had come as far as the furthest."""
        if self.is_open and self.identifier.samples.newest_ns is not None:
            self._solve_up_to(self.identifier.samples.newest_ns)

    def _clear(self) -> None:
        self._next_ns = None
        self._solve_ms = 0.0
        self._failure = ''
        self.estimate = None

    def _solve_up_to(self, settled_ns: int) -> None:
        """Solve at every period that is over: what comes in which order makes no difference.

        Beside the callbacks, at the last that is over as soon as the one before is solved.
        """
        if self._beside.is_busy:
            return
        samples, period_ns = self.identifier.samples, self._period_ns
        if self._next_ns is None:
            self._next_ns = (samples.origin_ns or 0) + period_ns
        if settled_ns <= self._next_ns:
            return
        stamp_ns = samples.after(self._next_ns)
        while stamp_ns is not None and stamp_ns <= settled_ns and not self._beside.is_busy:
            if self._beside.is_threaded:
                self._next_ns += (settled_ns - self._next_ns) // period_ns * period_ns
            self.solve(self._next_ns)
            self._next_ns += max(1, (stamp_ns - self._next_ns) // period_ns + 1) * period_ns
            stamp_ns = samples.after(self._next_ns)

    def _publish(self, estimate: Estimate) -> None:
        self.estimate = estimate
        self._publisher.publish(convert.estimate_message(estimate, self.health.count()))
        if estimate.valid:
            for link, h in zip(estimate.aam_links, estimate.aam.reshape(-1, 3), strict=True):
                self._momenta.publish(compose.momentum(estimate.stamp_ns, link, h))

    def _on_reset(self) -> tuple[bool, str]:
        self.reset('as asked for')
        return True, 'all samples forgotten'

    def _go_on(self, saved: Knowledge) -> None:
        self._replace(lambda identifier: identifier.go_on(saved))
        self._clear()
        self._publish(self.identifier.solve())

    def _on_solve(self) -> tuple[bool, str]:
        self.solve()
        is_done = self._beside.finish(ANSWER)
        message = self._estimate_status().message
        is_valid = self.estimate is not None and self.estimate.valid and not self._failure
        return is_valid, message if is_done else f'still solving; the last one: {message}'

    def _estimate_status(self) -> Status:
        estimate = self.estimate
        if self._failure:
            return Status('estimate', WARN, self._failure)
        if estimate is None:
            return Status('estimate', STALE, 'none yet')
        values: dict[str, object] = {
            'rank': f'{estimate.rank} of {estimate.unknowns}',
            'condition': float(estimate.condition),
            'samples': estimate.samples,
            'squared residuals per degree of freedom': float(estimate.chi2_per_dof),
            'time to solve [ms]': self._solve_ms,
        }
        std = estimate.std[: len(estimate.aam)]
        for axis, (value, sigma) in enumerate(zip(estimate.aam, std, strict=True)):
            values[f'aam {axis} [N m s]'] = f'{value:.6g} +- {sigma:.2g}'
        values |= outliers(self.identifier.left_out)
        if estimate.unexcited:
            values['not excited'] = '; '.join(estimate.unexcited)
        if estimate.valid:
            return Status('estimate', OK, 'valid', values)
        return Status('estimate', WARN, f'not valid: {estimate.reason}', values)
