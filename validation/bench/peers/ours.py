"""This package: `simulate_smooth` along a smooth torque, `Plant` with held ones."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import harness
import numpy as np
import servicer

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import DOP853, RK4, Tableau
from spacerobot_ros.dynamics.rotation import rotation_matrix
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.simulation.plant import Plant
from validation.smooth_motion import simulate_smooth

PACKAGE = Path(__file__).resolve().parents[3] / 'package.xml'
VERSION = ElementTree.parse(PACKAGE).findtext('version')
_OWN = {'base_link': 'base', 'gravity': [0.0, 0.0, 0.0]}
_OWN |= {'joints': [f'j_{name}' for name in servicer.JOINTS]}
ROBOT = build_robot(parse_settings({'robot': _OWN}), servicer.urdf())
START = State(
    np.zeros(3),
    servicer.ATTITUDE_XYZW,
    np.zeros(ROBOT.n_joints),
    np.zeros(3),
    servicer.OMEGA_B,
    servicer.RATES,
)


def motion_of(state: State) -> tuple:
    """What `harness.run_seconds` asks for."""
    R = rotation_matrix(state.q_WB_xyzw)
    velocity = R @ state.v_WB_B
    return R, R @ state.omega_WB_B, velocity, state.q, state.qd, state.q_WB_xyzw


def smooth(rtol: float) -> harness.Outcome:
    """Error control along the smooth torque, a state a second."""
    dynamics, tau = Dynamics(ROBOT), np.zeros(ROBOT.n_joints)

    def torque(t: float, _: object) -> np.ndarray:
        tau[:3] = servicer.torque(t)
        return tau

    times = np.linspace(0.0, servicer.DURATION, 21)
    start = harness.clock()
    states = simulate_smooth(dynamics, START.to_vector(), torque, times, rtol, 0.01 * rtol)
    seconds = harness.clock() - start
    motions = [motion_of(State.from_vector(x)) for x in states]
    momenta = [servicer.momentum(*motion[:5]) for motion in motions]
    *_, q, _, attitude = motions[-1]
    return harness.Outcome(seconds, momenta, attitude, q[:3])


def held(substeps: int, tableau: Tableau = DOP853) -> harness.Outcome:
    """Torques held over control periods, one call of `Plant.step` each."""
    plant = Plant(ROBOT, START, servicer.PERIOD, substeps, tableau=tableau)
    torques = np.zeros((round(servicer.DURATION / servicer.PERIOD), ROBOT.n_joints))
    torques[:, :3] = harness.held_torques()
    periods = round(1.0 / servicer.PERIOD)

    def advance(second: int) -> None:
        for tau in torques[second * periods : (second + 1) * periods]:
            plant.step(tau)

    return harness.run_seconds(advance, lambda: motion_of(plant.state))


def settings() -> list[harness.Setting]:
    """Tolerances and steps from coarse to fine."""
    return [
        *(('smooth', f'rtol {r:g}', lambda r=r: smooth(r)) for r in (1e-7, 1e-9, 1e-11, 1e-13)),
        ('held', 'order 4, 10 ms', lambda: held(1, RK4)),
        *(('held', f'order 8, {10 / n:g} ms', lambda n=n: held(n)) for n in (1, 2)),
    ]


if __name__ == '__main__':
    harness.report('spacerobot_ros', VERSION, settings())
