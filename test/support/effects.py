"""A robot under physical effects: the product's plant, and the same machine built in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effect, changed_robot
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.simulation.plant import Plant

from .models import Part, quaternion_matrix

PERIOD = 0.01  # s, of the held torques


def held_torque(k: int, n: int) -> np.ndarray:
    """(n,) torque of period k [N m]."""
    return np.asarray(3.0 * np.sin(0.02 * k + np.arange(n)))


def plant_with(
    robot: Robot, state: State, effect: str, where: str | None, values: Mapping[str, float]
) -> Plant:
    """The plant of a robot with one effect."""
    applied = bind_effect('hidden', effect, where, values, robot)
    return Plant(changed_robot(robot, [applied]), state, PERIOD, 1, [applied])


def run(plant: Plant, periods: int) -> State:
    """State after some periods of the held torques."""
    for k in range(periods):
        plant.step(held_torque(k, plant.n_arm))
    return plant.state


def motion_of(robot: Robot, rng: np.random.Generator, count: int = 1, **known: Any) -> Motion:
    """Random states of a robot."""
    n = robot.n_joints
    fields = {
        'omega': rng.standard_normal((count, 3)),
        'velocity': rng.standard_normal((count, 3)),
        **known,
    }
    time = np.linspace(0.0, 0.01 * (count - 1), count)
    drawn = [rng.standard_normal((count, n)) for _ in range(3)]
    return Motion(robot, time, drawn[0], drawn[1], drawn[2], **fields)


def without_mass(part: Part, mass: float, at: np.ndarray) -> Part:
    """A part less a point mass at a place of its frame, by the parallel axis theorem."""

    def about(point: np.ndarray) -> np.ndarray:
        return point @ point * np.eye(3) - np.outer(point, point)

    left = part.mass - mass
    com = (part.mass * part.com - mass * at) / left
    origin = part.inertia + part.mass * about(part.com) - mass * about(at)
    return replace(part, mass=left, com=com, inertia=origin - left * about(com))


class Engine:
    """MuJoCo with a model's text; joints by name.

    Args:
        mjcf: The model, with one motor a joint of `joints`.
        joints: Names of the joints with motors, in the order of torques.
    """

    def __init__(self, mjcf: str, joints: tuple[str, ...]) -> None:
        import mujoco

        self._mujoco = mujoco
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(self.model)
        self.joints = joints

    def angle(self, joint: str) -> float:
        """Position of a joint."""
        return float(self.data.qpos[self.model.joint(joint).qposadr[0]])

    @property
    def attitude_xyzw(self) -> np.ndarray:
        """Of the free base."""
        return np.roll(self.data.qpos[3:7], -1)

    def place(self, state: State) -> None:
        """Start there; joints that the state does not know are at rest at zero."""
        self.data.qpos[:3], self.data.qpos[3:7] = state.p_WB, np.roll(state.q_WB_xyzw, 1)
        self.data.qvel[:3] = quaternion_matrix(state.q_WB_xyzw) @ state.v_WB_B
        self.data.qvel[3:6] = state.omega_WB_B
        for name, q, qd in zip(self.joints, state.q, state.qd, strict=True):
            joint = self.model.joint(name)
            self.data.qpos[joint.qposadr[0]], self.data.qvel[joint.dofadr[0]] = q, qd

    def run(self, periods: int) -> None:
        """Some periods of the held torques."""
        for k in range(periods):
            self.data.ctrl[:] = held_torque(k, len(self.joints))
            self.rest(1)

    def rest(self, periods: int) -> None:
        """Some periods of the torques as they are, at first none."""
        for _ in range(periods * round(PERIOD / self.model.opt.timestep)):
            self._mujoco.mj_step(self.model, self.data)
