"""The runs of the demonstration, each with fresh nodes in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..control.joint_reference import check_reference
from ..effects.robot_file import RobotFile
from ..errors import ConfigurationError, IdentificationError
from ..identification.estimate import Estimate
from ..model.motion_settings import ReferenceSettings
from ..model.settings import Settings
from ..nodes.controller import ControllerNode
from ..nodes.identifier import IdentifierNode
from ..nodes.simulator import SimulatorNode
from ..recording.bags.bag_writer import BagWriter
from ..recording.messages import stamp_ns
from ..ros import convert
from ..ros.qos import LATCHED
from ..ros.session import Recorder, Session
from ..simulation.plant import Plant
from ..simulation.truth import true_robot
from ..types import Array
from .results import DemoResults, DemoRun, truth_of

OnProgress = Callable[[float], None]
"""Called with the simulated time done [s]."""


TOPICS = {
    '/clock': 'rosgraph_msgs/msg/Clock',
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/imu/data': 'sensor_msgs/msg/Imu',
    '/attitude': 'geometry_msgs/msg/QuaternionStamped',
    '/joint_commands': 'sensor_msgs/msg/JointState',
    '/tracking': 'spacerobot_msgs/msg/Tracking',
    '/estimate': 'spacerobot_msgs/msg/Estimate',
    '/simulator/ledger': 'spacerobot_msgs/msg/Ledger',
}
WHEELS = {'/wheel_states': 'sensor_msgs/msg/JointState'}  # of a servicer with true rotors
READ = ('/tracking', '/estimate', '/simulator/ledger')
ANSWERS = ('/tracking', '/joint_commands')


@dataclass
class _Log:
    """What a run leaves behind; joints and references (n,) [rad] by stamp [ns]."""

    joints: dict[int, Array] = field(default_factory=dict)
    references: dict[int, Array] = field(default_factory=dict)
    ledger: list[Any] = field(default_factory=list)  # messages
    estimates: list[Estimate] = field(default_factory=list)

    def read(self, topic: str, stamp_ns: int, cdr: bytes) -> None:
        """Note the reference that is followed, an estimate, or the momentum book."""
        if topic not in READ:
            return
        message = convert.deserialized(TOPICS[topic], cdr)
        if topic == '/tracking':
            self.references[stamp_ns] = np.array(message.reference_position)
        elif topic == '/estimate':
            self.estimates.append(convert.estimate(message))
        else:
            self.ledger.append(message)

    def see(self, plant: Plant) -> None:
        """Note the true state."""
        self.joints[plant.time_ns] = plant.state.q[: plant.n_arm]

    def to_run(self) -> DemoRun:
        """The finished run."""
        stamps = sorted(self.joints.keys() & self.references.keys())
        error = np.array([self.references[ns] - self.joints[ns] for ns in stamps])
        at = np.array([stamp_ns(book.header.stamp) * 1e-9 for book in self.ledger])
        momenta = [book.angular_momentum for book in self.ledger]
        angular = np.array([[h.x, h.y, h.z] for h in momenta])
        drift = np.array([book.momentum_drift for book in self.ledger])
        energy = np.array([book.energy_drift for book in self.ledger])
        time = np.array(stamps) * 1e-9
        return DemoRun(time, error, at, angular, drift, energy, tuple(self.estimates))


def demonstrate(
    file: RobotFile, passes: int, bags: Mapping[Path, Path],
    stage: Callable[[str, float], OnProgress],
) -> DemoResults:  # fmt: skip
    """Identify while tracking without the wheels, then track with them.

    Args:
        file: The robot file.
        passes: Of the motion that identifies.
        bags: Three to write, of the first pass after all passes and of the tracking last; and
            where each will be found.
        stage: Called with what is done and its length [s]; returns what is told of its progress.
    """
    started = time.perf_counter()
    check_file(file)
    settings, length = file.settings, file.settings.reference.duration
    *exciting, tracking = bags
    truth = truth_of(file.robot, true_robot(file.robot, settings), settings.identifier.structure)
    advance = stage('tracking without the wheels, identifying them', passes * length)
    found = identify(file, passes, exciting, advance)
    advance = stage('tracking with them', length)
    identified = track(file, found.estimates[-1], tracking, advance)
    return DemoResults(
        robot=file.robot.name, joints=file.robot.arm, seed=settings.simulator.seed,
        identification=found, no_aam=found.until(length), identified=identified, truth=truth,
        bags=tuple(map(str, bags.values())), wall=time.perf_counter() - started,
    )  # fmt: skip


def check_file(file: RobotFile) -> None:
    """Refuse a robot file that has nothing to demonstrate.

    Raises:
        ConfigurationError: a fixed base, no joints that turn, no captured wheels that spin, no
            exciting motion, or sensors the runs can't use.
    """
    robot, settings = file.robot, file.settings
    if not robot.is_free:
        why = 'the demonstration needs a free base: on a fixed one wheels turn nothing'
        raise ConfigurationError('robot.base', why)
    if not robot.arm:
        raise ConfigurationError('robot.joints', 'the demonstration needs joints to move')
    for name, body in zip(robot.arm, robot.bodies[1:], strict=False):
        if body.is_prismatic:
            why = f'the demonstration compares angles, and {name!r} slides'
            raise ConfigurationError('robot.joints', why)
    if not robot.target_wheels:
        why = 'the demonstration needs a captured body: name its link under links'
        raise ConfigurationError('robot.target_wheels', why)
    if not true_robot(robot, settings).target_momentum.any():
        side = 'rates' if any(rotor.is_target for rotor in robot.rotors) else 'momentum'
        why = 'the captured wheels are at rest: the demonstration has nothing to find'
        raise ConfigurationError(f'truth.target_{side}', why)
    _check_motion(settings.reference, len(robot.arm))
    if round(settings.simulator.joint_rate * settings.simulator.period) != 1:
        raise ConfigurationError('simulator.joint_rate', 'must be the control rate here')


def _check_motion(options: ReferenceSettings, n: int) -> None:
    designed = '`spacerobot excite` designs such a motion'
    if options.kind != 'fourier':
        why = f"the demonstration needs 'fourier': {designed}"
        raise ConfigurationError('reference.kind', why)
    check_reference(options, n)
    if not any((*options.sine, *options.cosine)):
        why = f'all joints stand still, and the demonstration must move them: {designed}'
        raise ConfigurationError('reference.sine', why)


def identify(file: RobotFile, passes: int, bags: Sequence[Path], progress: OnProgress) -> DemoRun:
    """Excite the robot with a controller that knows nothing of the wheels, and identify it.

    Args:
        file: The robot file.
        passes: How often the motion is run through.
        bags: Folder of the bag, and of one of the first pass without estimates.
        progress: Shown the simulated time.

    Raises:
        IdentificationError: the last estimate is not valid.
    """
    settings = _settings(file, 'computed_torque_no_aam', passes)
    run = _run(file, settings, passes, bags, progress, identifies=True)
    if not run.estimates or not run.estimates[-1].valid:
        reason = run.estimates[-1].reason if run.estimates else 'there is none'
        raise IdentificationError(f'the estimate is not valid: {reason}')
    return run


def track(
    file: RobotFile, estimate: Estimate | None, bag: Path, progress: OnProgress | None = None
) -> DemoRun:
    """Track the motion once, from the initial state.

    Args:
        file: The robot file.
        estimate: What the controller knows; None: nothing of the wheels.
        bag: Folder of the bag.
        progress: As of `identify`.
    """
    law = 'computed_torque_no_aam' if estimate is None else 'computed_torque'
    return _run(file, _settings(file, law), 1, [bag], progress, estimate)


def _settings(file: RobotFile, law: str, passes: int = 1) -> Settings:
    return file.settings.changed(
        {
            'simulator.lockstep': True,
            'controller.law': law,
            'controller.use_estimate': True,
            'reference.repeat': passes > 1,
        }
    )


def _run(
    file: RobotFile,
    settings: Settings,
    passes: int,
    bags: Sequence[Path],
    progress: OnProgress | None,
    estimate: Estimate | None = None,
    identifies: bool = False,
) -> DemoRun:
    urdf, log = file.robot.urdf, _Log()
    pass_ns = round(1e9 * settings.reference.duration)
    with ExitStack() as open_bags, Session() as session:
        writers = [open_bags.enter_context(BagWriter(bag, overwrite=True)) for bag in bags]
        for writer in writers:
            writer.text('/robot_description', 0, urdf)
        ears = session.plain('demo')
        has_wheels = any(not rotor.is_target for rotor in file.robot.rotors)
        topics = {**TOPICS, **(WHEELS if has_wheels else {})}
        types = {topic: convert.message_type(kind) for topic, kind in topics.items()}

        def keep(topic: str, kind: str, stamp_ns: int, cdr: bytes) -> None:
            is_tracking = stamp_ns <= pass_ns and topic != '/estimate'
            for writer in writers[: 1 + is_tracking]:
                writer.message(topic, kind, stamp_ns, cdr)
            log.read(topic, stamp_ns, cdr)

        recorder = Recorder(ears, types, keep)
        controller = session.add(ControllerNode, settings, urdf)
        if estimate is not None:
            _send(session, ears, controller, estimate)
        identifier = session.add(IdentifierNode, settings, urdf) if identifies else None
        simulator = session.add(SimulatorNode, settings, urdf, owns_time=True)
        simulator.stop_at = round(passes * settings.reference.duration / settings.simulator.period)
        simulator.observers.append(log.see)
        if progress is not None:
            simulator.observers.append(lambda plant: progress(plant.time_ns * 1e-9))
        simulator.pause(True)
        session.connect()
        simulator.pause(False)
        end_ns = simulator.stop_at * simulator.plant.period_ns
        session.until(
            lambda: (
                simulator.step_index == simulator.stop_at
                and recorder.has(simulator.sent_ns | dict.fromkeys(ANSWERS, end_ns))
            ),
            lambda: (simulator.step_index, len(log.references)),
        )
        if identifier is not None:
            _finish(session, identifier, recorder, log)
    return log.to_run()


def _send(session: Session, ears: Any, controller: ControllerNode, estimate: Estimate) -> None:
    """Publish an estimate of an earlier run, stamped with the start of this one."""
    message = convert.estimate_message(replace(estimate, stamp_ns=0), 0)
    ears.create_publisher(type(message), '/estimate', LATCHED).publish(message)
    session.until(lambda: controller.loop.estimate is not None, lambda: 'the estimate')


def _finish(session: Session, identifier: IdentifierNode, recorder: Recorder, log: _Log) -> None:
    """Have the last samples used, too."""
    identifier.flush()
    identifier.solve()
    if identifier.estimate is None:
        return
    stamp = identifier.estimate.stamp_ns

    def arrived() -> bool:
        is_published = bool(log.estimates) and log.estimates[-1].stamp_ns == stamp
        return is_published and recorder.newest_ns['/estimate'] == stamp

    session.until(arrived, lambda: 'the last estimate')
