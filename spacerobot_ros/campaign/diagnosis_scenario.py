"""Robots, motions and records of the diagnosis campaign: the project's own plant with effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ..control.loop import ControlLoop
from ..control.reference import build_reference
from ..diagnosis.answer.extended_model import effects_section
from ..effects.effect import Effect
from ..effects.robot_file import RobotFile, load_robot_file
from ..errors import SimulationDivergedError
from ..model.loader import resolve_urdf
from ..model.settings import ReferenceSettings, TruthSettings
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from ..simulation.closed_loop import ClosedLoop, Step
from ..types import Array, IntArray

ROBOTS = ('servicer', 'minisat')
EXCITATIONS = {'default': (0.3, 2, 4), 'fast': (0.6, 5, 8), 'slow': (0.3, 1, 2)}
"""Name to largest angle of a joint [rad], first and last harmonic of the record's length."""

DURATION = 20.0  # s of a record
_UNSTABLE = 5.0  # times the motion's fastest rate: no controller would be flown like that
_RATE = 100.0  # Hz of joints and gyro; the tracker has a tenth
_WHEELS = {'servicer': (42.0, 49.0, 41.0)}  # N m s in the captured body, known to the model


@cache
def robot_file(name: str) -> RobotFile:
    """A robot of `ROBOTS` with 100 Hz sensors, its model as the plant is."""
    path = resolve_urdf(f'package://spacerobot_ros/config/{name}.urdf', None)
    file = load_robot_file(path.with_suffix('.yaml'))
    robot = file.robot
    if name in _WHEELS:
        robot = robot.with_target_momentum(np.array(_WHEELS[name]))
    simulator = replace(
        file.settings.simulator,
        period=1.0 / _RATE,
        joint_rate=_RATE,
        imu_rate=_RATE,
        attitude_rate=0.1 * _RATE,
    )
    controller = replace(file.settings.controller, law='computed_torque')
    settings = replace(
        file.settings, simulator=simulator, controller=controller, truth=TruthSettings()
    )
    return RobotFile(robot=robot, settings=settings, effects=file.effects)


def simulated(
    robot: str,
    excitation: str,
    seed: int,
    effects: Sequence[Effect] = (),
    duration: float = DURATION,
) -> Record:
    """A record of the robot with effects that neither its file nor its controller knows.

    Args:
        robot: One of `ROBOTS`.
        excitation: One of `EXCITATIONS`.
        seed: Of motion and noise.
        effects: What the plant has beyond the file.
        duration: [s].

    Raises:
        SimulationDivergedError: the controller is not stable with the effects.
    """
    file = robot_file(robot)
    reference = _motion(file.robot.n_joints, excitation, seed, duration)
    simulator = replace(file.settings.simulator, seed=seed)
    believed = replace(file.settings, reference=reference, simulator=simulator)
    loop = ClosedLoop(file.robot, replace(believed, effects=effects_section(effects)))
    loop.controller = ControlLoop(file.robot, believed)
    steps = list(loop.run(round(duration / simulator.period)))
    asked = build_reference(reference, np.zeros(file.robot.n_joints))
    times = np.linspace(0.0, duration, len(steps))
    _check_stable(steps, max(float(np.max(np.abs(asked.at(t).qd))) for t in times))
    return _record(loop.joints, steps, f'{robot}, {excitation}, seed {seed}')


def _check_stable(steps: Sequence[Step], fastest: float) -> None:
    for step in steps:
        joints = step.measured.joints
        if joints is not None and np.max(np.abs(joints.velocity)) > _UNSTABLE * fastest:
            reason = f'a joint is {_UNSTABLE:g} times as fast as asked: an unstable controller'
            raise SimulationDivergedError(1e-9 * step.stamp_ns, reason)


def _motion(n: int, excitation: str, seed: int, duration: float) -> ReferenceSettings:
    """Random harmonics of the record's length, each joint up to the same angle."""
    largest, first, last = EXCITATIONS[excitation]
    order = np.arange(first, last + 1)
    rng = np.random.default_rng([seed, 7])
    sine, cosine = rng.standard_normal((2, n, len(order))) / order
    angle = 2.0 * np.pi * np.linspace(0.0, 1.0, 400)[:, None] * order
    w = 2.0 * np.pi * order / duration
    moved = (np.sin(angle) / w) @ sine.T - (np.cos(angle) / w) @ cosine.T
    scale = largest / np.max(np.abs(moved - moved[0]), axis=0)[:, None]
    coefficients = np.zeros((2, n, last))
    coefficients[:, :, first - 1 :] = sine * scale, cosine * scale
    return ReferenceSettings(
        kind='fourier',
        duration=duration,
        harmonics=last,
        sine=tuple(coefficients[0].ravel().tolist()),
        cosine=tuple(coefficients[1].ravel().tolist()),
    )


def _record(joints: tuple[str, ...], steps: Sequence[Step], source: str) -> Record:
    told = [(s.stamp_ns, s.measured.joints) for s in steps if s.measured.joints is not None]
    rates = [(s.stamp_ns, s.measured.omega) for s in steps if s.measured.omega is not None]
    turns = [
        (s.stamp_ns, s.measured.attitude_xyzw)
        for s in steps
        if s.measured.attitude_xyzw is not None
    ]
    return Record(
        joints=JointSeries(
            joints,
            np.array([stamp for stamp, _ in told]),
            np.array([j.position for _, j in told]),
            np.array([j.velocity for _, j in told]),
            np.array([j.effort for _, j in told]),
        ),
        rates=RateSeries(*_columns(rates)) if rates else None,
        attitudes=AttitudeSeries(*_columns(turns)) if turns else None,
        source=source,
    )


def _columns(samples: Sequence[tuple[int, Array]]) -> tuple[IntArray, Array]:
    return np.array([stamp for stamp, _ in samples]), np.array([value for _, value in samples])
