"""One effect in the plant and in MuJoCo, which share no code: the same start, the same torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effects, changed_robot
from spacerobot_ros.simulation.plant import Plant
from validation.mujoco.plan import Plan
from validation.mujoco.run import Simulation
from validation.replay.plant import about, bodies_of

from .models import (
    ATTITUDE_XYZW,
    H_BASE,
    H_TARGET,
    OMEGA,
    Part,
    quaternion_matrix,
    robot_of,
    to_urdf,
)

PERIOD = 0.01
STEPS_A_PERIOD = 10
TORQUE = np.array([6.0, -4.0, 3.0])  # N m, held: the arm moves by a third of a radian in 2 s
Q0 = np.array([0.3, -0.5, 0.4])


@dataclass(frozen=True)
class End:
    """Joints, rates, attitude matrix and base rate at the end of a run."""

    q: np.ndarray
    qd: np.ndarray
    rotation: np.ndarray
    omega: np.ndarray


def plant_with(parts: list[Part], entries: dict[str, dict[str, Any]], **robot: Any) -> Plant:
    """Our plant at the common start, under effects given as in a robot file."""
    built = robot_of(parts, **robot)
    effects = bind_effects(entries, built)
    turning = OMEGA if built.is_free else np.zeros(3)
    attitude = ATTITUDE_XYZW if built.is_free else np.array([0.0, 0.0, 0.0, 1.0])
    start = State(np.zeros(3), attitude, Q0, np.zeros(3), turning, np.zeros(3))
    return Plant(changed_robot(built, effects), start, PERIOD, 1, effects)


def run_plant(plant: Plant, seconds: float) -> End:
    """Our plant at the end, under constant torques."""
    for _ in range(round(seconds / PERIOD)):
        plant.step(TORQUE)
    state = plant.state
    return End(state.q, state.qd, quaternion_matrix(state.q_WB_xyzw), state.omega_WB_B)


def run_mujoco(
    parts: list[Part],
    effect: str,
    where: str | None,
    values: dict[str, Any],
    seconds: float,
    *,
    free: bool = True,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    wheels: dict[str, np.ndarray] | None = None,
) -> End:
    """MuJoCo at the end, the effect added by the truth generator's own code."""
    joints = tuple(part.joint for part in parts[1:])
    own = {
        'gravity': np.array(gravity),
        'wheels': dict(wheels or {}),
        'gain': np.ones(len(joints)),
    }
    plan = Plan(bodies_of(to_urdf(parts)), joints, 'base_link', free, **own)
    plan.hide([(effect, where, values)])
    simulation = Simulation(plan, PERIOD / STEPS_A_PERIOD)
    simulation.place(Q0, ATTITUDE_XYZW, OMEGA)
    simulation.torque = lambda: TORQUE
    history = simulation.run(
        round(seconds / PERIOD) * STEPS_A_PERIOD, STEPS_A_PERIOD, lambda _: None
    )
    w, x, y, z = history.attitude[-1]
    rotation = quaternion_matrix(np.array([x, y, z, w]))
    return End(history.q[-1], history.qd[-1], rotation, history.omega[-1])


def point_mass(mass: float, com: tuple[float, float, float]) -> dict[str, float]:
    """`inertial_parameters` of a mass [kg] at a point of the link's frame [m]."""
    at, moments = mass * np.array(com), mass * about(np.array(com))
    out = {'mass': mass, **dict(zip(('mx', 'my', 'mz'), at.tolist(), strict=True))}
    pairs = [(i, j) for i in range(3) for j in range(i + 1)]
    return out | {f'i{"xyz"[j]}{"xyz"[i]}': float(moments[i, j]) for i, j in pairs}


def assert_same(ours: End, theirs: End, tolerance: float) -> None:
    """Ends that agree in rad and rad/s."""
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.qd, theirs.qd, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.rotation, theirs.rotation, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.omega, theirs.omega, rtol=0, atol=tolerance)


WHEELS = {
    'servicer_wheels': {'momentum': [float(x) for x in H_BASE]},
    'target_wheels': {'links': ['link_3'], 'momentum': [float(x) for x in H_TARGET]},
}
MUJOCO_WHEELS = {'base_link': H_BASE, 'link_3': H_TARGET}
