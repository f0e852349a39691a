"""The mini space robot with wrong beliefs, its harmonic task, and a law without a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings, Measured, Target
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State, initial_state
from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.simulation.truth import true_robot
from support.states import hold_step

from .attitudes import angle_between

ROBOT_FILE = 'config/minisat.yaml'
JOINTS = ('joint_1', 'joint_2', 'joint_3', 'joint_4')
SWING = np.radians(10.0)
CYCLE = 20.0  # s
MOVES = np.array([0.0, 1.0, 1.0, 1.0])
HEAVIER = (1.15, 0.8, 1.25, 0.85, 1.2)  # true over believed density of each body


def free_flying_parameters(law: str, period: float, **more: Any) -> dict[str, Any]:
    """Parameters by dotted name: the harmonic task, wrong beliefs, exact sensors.

    Args:
        law: Of `controller.law`.
        period: Control period [s].
        more: Further parameters, dots as double underscores.
    """
    robot = load_robot_file(ROBOT_FILE).robot
    truth = robot.inertial_parameters * np.array(HEAVIER)[:, None]
    rate = 1.0 / period
    return {
        'controller.law': law,
        'reference.kind': 'harmonic',
        'reference.duration': CYCLE,
        'reference.amplitude': (SWING * MOVES).tolist(),
        'reference.attitude_amplitude': [SWING, 0.0, 0.0],
        'simulator.period': period,
        'simulator.joint_rate': rate,
        'simulator.imu_rate': rate,
        'simulator.attitude_rate': rate,
        'simulator.noise': False,
        'truth.links': [body.name for body in robot.bodies],
        'truth.inertial_parameters': truth.ravel().tolist(),
        **{name.replace('__', '.'): value for name, value in more.items()},
    }


def file_with(parameters: dict[str, Any]) -> RobotFile:
    """The robot file with parameters by dotted name replaced."""
    file = load_robot_file(ROBOT_FILE)
    sections: dict[str, dict[str, Any]] = {}
    for name, value in parameters.items():
        section, key = name.split('.')
        sections.setdefault(section, {})[key] = tuple(value) if isinstance(value, list) else value
    changed = {
        section: replace(getattr(file.settings, section), **values)
        for section, values in sections.items()
    }
    return RobotFile(file.robot, replace(file.settings, **changed))


def wanted(start: State, t: float) -> Target:
    """Point of the harmonic task."""
    w = 2.0 * np.pi / CYCLE
    s, c, axis = SWING * np.sin(w * t), SWING * np.cos(w * t), np.array([1.0, 0.0, 0.0])
    attitude = np.array([np.sin(0.5 * s), 0.0, 0.0, np.cos(0.5 * s)])
    rates = (w * c * axis, -(w**2) * s * axis)
    return Target(attitude, *rates, start.q + s * MOVES, w * c * MOVES, -(w**2) * s * MOVES)


def errors(start: State, state: State, t: float) -> np.ndarray:
    """(1 + n,) true errors of attitude angle and joints [rad]."""
    target = wanted(start, t)
    return np.append(angle_between(target.q_WD_xyzw, state.q_WB_xyzw), target.q - state.q)


def core_errors(file: RobotFile, steps: int) -> np.ndarray:
    """(steps, 1 + n) true errors of the law alone on the plant: no loop, no sensors, no nodes."""
    truth, period = true_robot(file.robot, file.settings), file.settings.simulator.period
    law = AdaptiveController(file.robot, AdaptiveSettings.of(file.settings), period)
    dynamics, start = Dynamics(truth), initial_state(truth, file.settings.initial)
    x, out = dynamics.at_rest_centre(start).to_vector(), []
    for k in range(steps):
        s = State.from_vector(x)
        out.append(errors(start, s, k * period))
        measured = Measured(s.q_WB_xyzw, s.omega_WB_B, s.q, s.qd)
        torques = law.step(measured, wanted(start, k * period))
        wrench = np.concatenate([np.zeros(3), torques.base])
        x = hold_step(dynamics, x, torques.joints, period, 1, wrench)
    return np.array(out)


def rms_degrees(errors: np.ndarray) -> np.ndarray:
    """(2,) root mean squares of attitude and joint norm over the second half [deg]."""
    half = errors[len(errors) // 2 :]
    squares = half**2
    return np.degrees(np.sqrt([squares[:, 0].mean(), squares[:, 1:].sum(axis=1).mean()]))


def estimate_of(file: RobotFile, std: float = 1e-3) -> Estimate:
    """What an identifier would say of the true robot, with a relative standard deviation."""
    truth = true_robot(file.robot, file.settings)
    minimal = minimal_set(file.robot, file.settings.identifier.structure)
    values = minimal.of_robot(truth)
    size = len(values)
    return Estimate(
        method='online',
        valid=True,
        reason='',
        aam_links=(),
        aam=np.zeros(0),
        parameter_names=minimal.names,
        parameters=values,
        covariance=np.diag((std * np.abs(values) + 1e-6) ** 2),
        rank=size,
        unknowns=size,
        condition=1.0,
        unexcited=(),
        total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3),
        chi2_per_dof=1.0,
        samples=1,
        stamp_ns=0,
    )
