"""The three runs of the demonstration, each with fresh nodes in one process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import QuaternionStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Ledger, Tracking

from ..effects.robot_file import RobotFile
from ..errors import ConfigurationError, IdentificationError
from ..identification.estimate import Estimate
from ..model.settings import Settings
from ..nodes.controller import ControllerNode
from ..nodes.identifier import IdentifierNode
from ..nodes.simulator import SimulatorNode
from ..recording.bag_writer import BagWriter
from ..ros import convert
from ..ros.qos import LATCHED, SAMPLES
from ..ros.session import Recorder, Session
from ..simulation.plant import Plant
from ..types import Array
from .results import Run

Progress = Callable[[float], None]
"""Called with the simulated time done [s]."""

TOPICS: dict[str, Any] = {
    '/clock': Clock,
    '/joint_states': JointState,
    '/imu/data': Imu,
    '/attitude': QuaternionStamped,
    '/joint_commands': JointState,
    '/tracking': Tracking,
    '/estimate': EstimateMessage,
    '/simulator/ledger': Ledger,
}
LAST = ('/tracking', '/joint_commands', '/joint_states')


@dataclass
class _Log:
    """What a run leaves behind while it goes on."""

    time: list[float] = field(default_factory=list)
    joints: list[Array] = field(default_factory=list)
    references: list[Array] = field(default_factory=list)
    ledger: list[tuple[float, Array, float, float]] = field(default_factory=list)
    estimates: list[Estimate] = field(default_factory=list)

    def see(self, plant: Plant) -> None:
        """Note the true state."""
        time = plant.time_ns * 1e-9
        self.time.append(time)
        self.joints.append(plant.state.q[: plant.n_arm].copy())
        if plant.step_index % 10 == 0:
            book = plant.ledger()
            self.ledger.append((time, book.angular, book.momentum_drift, book.energy_drift))

    def to_run(self) -> Run:
        """The finished run."""
        count = min(len(self.joints), len(self.references))
        error = np.array(self.references[:count]) - np.array(self.joints[:count])
        ledger_time, angular, drift, energy = (np.array(c) for c in zip(*self.ledger, strict=True))
        return Run(
            np.array(self.time[:count]),
            error,
            ledger_time,
            angular,
            drift,
            energy,
            tuple(self.estimates),
        )


def check_file(file: RobotFile) -> None:
    """Refuse a robot file that has nothing to demonstrate.

    Raises:
        ConfigurationError: no exciting motion, no captured body, or sensors the runs can't use.
    """
    settings = file.settings
    if settings.reference.kind != 'fourier':
        raise ConfigurationError('reference.kind', "the demonstration needs 'fourier'")
    if not file.robot.target_wheels:
        raise ConfigurationError('robot.target_wheels', 'the demonstration needs a captured body')
    if round(settings.simulator.joint_rate * settings.simulator.period) != 1:
        raise ConfigurationError('simulator.joint_rate', 'must be the control rate here')


def identify(file: RobotFile, passes: int, bag: Path, progress: Progress) -> Run:
    """Excite the robot with a controller that knows nothing of the wheels, and identify it.

    Args:
        file: The robot file.
        passes: How often the motion is run through.
        bag: Folder of the bag.
        progress: Shown the simulated time.

    Raises:
        IdentificationError: the last estimate is not valid.
    """
    settings = _settings(file, 'computed_torque_no_aam')
    settings = replace(settings, reference=replace(settings.reference, repeat=passes > 1))
    plan = _Plan(settings, passes * settings.reference.duration, bag, identifies=True)
    run = _run(file, plan, progress)
    if not run.estimates or not run.estimates[-1].valid:
        reason = run.estimates[-1].reason if run.estimates else 'there is none'
        raise IdentificationError(f'the estimate is not valid: {reason}')
    return run


def track(file: RobotFile, estimate: Estimate | None, bag: Path, progress: Progress) -> Run:
    """Track the motion once, from the initial state.

    Args:
        file: The robot file.
        estimate: What the controller knows; None: nothing of the wheels.
        bag: Folder of the bag.
        progress: Shown the simulated time.
    """
    law = 'computed_torque_no_aam' if estimate is None else 'computed_torque'
    settings = _settings(file, law)
    return _run(file, _Plan(settings, settings.reference.duration, bag, estimate), progress)


def _settings(file: RobotFile, law: str) -> Settings:
    settings = file.settings
    return replace(
        settings,
        simulator=replace(settings.simulator, lockstep=True),
        controller=replace(settings.controller, law=law, use_estimate=True),
        reference=replace(settings.reference, repeat=False),
    )


@dataclass(frozen=True)
class _Plan:
    """One run: settings, length [s], bag, estimate to begin with, whether to identify."""

    settings: Settings
    duration: float
    bag: Path
    estimate: Estimate | None = None
    identifies: bool = False


def _run(file: RobotFile, plan: _Plan, progress: Progress) -> Run:
    settings, urdf, log = plan.settings, file.robot.urdf, _Log()
    writer = BagWriter(plan.bag, overwrite=True)
    with writer, Session() as session:
        writer.text('/robot_description', 0, urdf)
        ears = session.plain('demo')
        recorder = Recorder(ears, TOPICS, writer.message)
        _listen(ears, log)
        controller = session.add(ControllerNode, settings, urdf)
        if plan.estimate is not None:
            _tell(session, ears, controller, plan.estimate)
        identifier = session.add(IdentifierNode, settings, urdf) if plan.identifies else None
        simulator = session.add(SimulatorNode, settings, urdf)
        simulator.stop_at = round(plan.duration / settings.simulator.period)
        simulator.observers.append(log.see)
        simulator.observers.append(lambda plant: progress(plant.time_ns * 1e-9))
        end_ns = simulator.stop_at * simulator.plant.period_ns
        session.until(
            lambda: recorder.has_reached(end_ns, LAST) and len(log.references) > simulator.stop_at,
            lambda: (simulator.step_index, len(log.references)),
        )
        if identifier is not None:
            _finish(session, identifier, recorder, log)
    return log.to_run()


def _listen(ears: Any, log: _Log) -> None:
    def on_tracking(message: Tracking) -> None:
        log.references.append(np.array(message.reference_position))

    def on_estimate(message: EstimateMessage) -> None:
        log.estimates.append(convert.estimate(message))

    ears.create_subscription(Tracking, '/tracking', on_tracking, SAMPLES)
    ears.create_subscription(EstimateMessage, '/estimate', on_estimate, SAMPLES)


def _tell(session: Session, ears: Any, controller: ControllerNode, estimate: Estimate) -> None:
    """Publish an estimate of an earlier run, stamped with the start of this one."""
    teller = ears.create_publisher(EstimateMessage, '/estimate', LATCHED)
    teller.publish(convert.estimate_message(replace(estimate, stamp_ns=0), 0))
    session.until(lambda: controller.loop.estimate is not None, lambda: 'the estimate')


def _finish(session: Session, identifier: IdentifierNode, recorder: Recorder, log: _Log) -> None:
    """Have the last samples used, too."""
    identifier.flush()
    identifier.solve()
    if identifier.estimate is None:
        return
    stamp = identifier.estimate.stamp_ns

    def arrived() -> bool:
        heard = bool(log.estimates) and log.estimates[-1].stamp_ns == stamp
        return heard and recorder.newest_ns['/estimate'] == stamp

    session.until(arrived, lambda: 'the last estimate')
