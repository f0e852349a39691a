"""Robot files for the excitation tests, built from parts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.estimation.trajectory.base_response import noise_free_record
from spacerobot_ros.excitation.problem import Problem
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import Record
from support.identification import _COSINE, _SINE, STDS
from support.models import AXIS, H_BASE, H_TARGET, Part, random_inertia, table_one, to_urdf

TABLE_TWO = {
    'kind': 'fourier',
    'duration': 20.0,
    'harmonics': 3,
    'sine': [x for row in _SINE for x in row],
    'cosine': [x for row in _COSINE for x in row],
}


def robot_file(parts: list[Part] | None = None, *, wheels: Any = H_BASE, **sections: Any):
    """A robot file of these parts (default: Table I's); captured wheels as in Table I."""
    parts = parts or table_one()
    values = {
        'robot': {
            'joints': [part.joint for part in parts[1:]],
            'servicer_wheels': {'momentum': [float(h) for h in wheels]},
            'target_wheels': {'links': [parts[-1].name], 'momentum': H_TARGET.tolist()},
        },
        'sensors': {**STDS, 'joint_effort_std': 0.05},
        'initial': {
            'attitude_xyzw': [0.2, 0.1, 0.3, 0.927],
            'angular_velocity': [0.1, 0.12, 0.08],
        },
        **sections,
    }
    settings = parse_settings(values)
    return RobotFile(build_robot(settings, to_urdf(parts)), settings)


def with_excitation(file: RobotFile, **changes: Any) -> RobotFile:
    """The same file with other settings of the search."""
    excitation = replace(file.settings.excitation, **changes)
    return replace(file, settings=replace(file.settings, excitation=excitation))


def noisy_record(problem: Problem, x: np.ndarray, seed: int) -> Record:
    """A motion of the robot assumed, at 100 Hz, as noisy sensors see it."""
    family = problem.family.at(np.arange(round(100 * problem.family.duration) + 1) / 100.0)
    motion = problem.move(x[None], family)
    return with_noise(noise_free_record(problem.robot, motion, problem.settings.simulator), seed)


def with_noise(record: Record, seed: int) -> Record:
    """Add the noise of `STDS`."""
    rng = np.random.default_rng(seed)
    joints, rates, attitudes = record.joints, record.rates, record.attitudes

    def noisy(values: np.ndarray, name: str) -> np.ndarray:
        return values + STDS[f'{name}_std'] * rng.standard_normal(values.shape)

    turn = Rotation.from_rotvec(noisy(np.zeros((len(attitudes.q_xyzw), 3)), 'attitude'))
    return replace(
        record,
        joints=replace(
            joints,
            position=noisy(joints.position, 'joint_position'),
            velocity=noisy(joints.velocity, 'joint_velocity'),
        ),
        rates=replace(rates, omega=noisy(rates.omega, 'gyro')),
        attitudes=replace(
            attitudes, q_xyzw=(Rotation.from_quat(attitudes.q_xyzw) * turn).as_quat()
        ),
    )


def six_joints(*, dual: bool = False) -> list[Part]:
    """One arm of six joints, or two of three, with a heavy last link and no symmetry."""
    rng = np.random.default_rng(3)
    parts = [Part('base_link', -1, 'base', 1500.0, np.zeros(3), np.diag([900.0, 1000.0, 1100.0]))]
    for k, axis in enumerate('zyxzyx'):
        second = dual and k >= 3
        parent = 0 if dual and k == 3 else k
        origin = np.array([0.9, 0.0, 0.05])
        if parent == 0:
            origin = np.array([0.5, -0.3 if second else 0.3, 0.8])
        heavy = k == 5
        parts.append(
            Part(
                f'link_{k + 1}',
                parent,
                'continuous',
                300.0 if heavy else 15.0,
                np.array([0.45, 0.02, 0.03]),
                random_inertia(rng, 40.0 if heavy else 1.0),
                AXIS[axis],
                origin,
            )
        )
    return parts
