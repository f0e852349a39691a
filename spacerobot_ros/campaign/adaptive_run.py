"""One closed loop of the adaptive-control experiments: law, plant, sensors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..control.adaptive.controller import AdaptiveController
from ..control.adaptive.settings import AdaptiveSettings
from ..control.adaptive.tree import parameter_values
from ..control.adaptive.types import Measured
from ..dynamics.equations import Dynamics
from ..dynamics.integrate import hold_step
from ..dynamics.state import State
from ..errors import SimulationDivergedError
from ..model.robot import Robot
from ..model.settings import SensorSettings
from ..types import Array
from .adaptive_scenario import START, harmonic, minisat, orientation, torque_error, wrong_prior

TASKS = {'orientation': orientation, 'harmonic': harmonic}
_SUBSTEP = 0.05  # longest Runge-Kutta step [s]
_DIVERGED = np.deg2rad(170.0)  # an error from which on a run counts as diverged [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What to run.

    Args:
        task: `orientation` or `harmonic`.
        settings: The law's.
        prior: `true`, `iid` or `physical`.
        eta: Size of its errors.
        seed: Of its draw.
        period: Control period [s].
        duration: [s].
        noise: Factor on the noise of `config/minisat.yaml`.
        noise_seed: Of the noise.
        measures_velocity: Whether the base's velocity is measured.
    """

    task: str
    settings: AdaptiveSettings
    prior: str = 'true'
    eta: float = 0.0
    seed: int = 0
    period: float = 0.05
    duration: float = 60.0
    noise: float = 0.0
    noise_seed: int = 0
    measures_velocity: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A run.

    Args:
        case: What was run.
        time: (N,) of the samples [s].
        attitude_error: (N,) angle [rad].
        joint_error: (N, 4) [rad].
        torque: (N, 7) commands [N m].
        base: (N, 10) base's parameters in force.
        indefinite: Part of the steps with parameters of no physical body.
        torque_error: Relative error of the torques that the final parameters predict.
        prior_torque_error: The same of the prior's.
        diverged: Whether the errors left all bounds.
    """

    case: Case
    time: Array
    attitude_error: Array
    joint_error: Array
    torque: Array
    base: Array
    indefinite: float
    torque_error: float
    prior_torque_error: float
    diverged: bool

    def rms_deg(self, last: float = 20.0) -> tuple[float, float]:
        """Root mean squares of the attitude error and of the joint errors' norm [deg]."""
        keep = self.time > self.time[-1] - last
        attitude = np.sqrt(np.mean(self.attitude_error[keep] ** 2))
        joints = np.sqrt(np.mean(np.sum(self.joint_error[keep] ** 2, axis=1)))
        return float(np.rad2deg(attitude)), float(np.rad2deg(joints))


def run_case(case: Case) -> Run:
    """Simulate a case."""
    plant = minisat()
    prior = wrong_prior(case.prior, case.eta, case.seed)
    sensors = SensorSettings()
    if case.noise:
        rates = {'joint_velocity_std': plant.sensors.joint_velocity_std or 0.0}
        rates['gyro_std'] = plant.sensors.gyro_std or 0.0
        rates['joint_effort_std'] = plant.sensors.joint_effort_std or 0.0
        sensors = SensorSettings(**{name: case.noise * std for name, std in rates.items()})
    controller = AdaptiveController(replace(prior, sensors=sensors), case.settings, case.period)
    loop = _Loop(case, controller, plant)
    diverged = loop.run()
    count = loop.count
    return Run(
        case=case,
        time=case.period * np.arange(count, dtype=float),
        attitude_error=loop.attitude[:count],
        joint_error=loop.joints[:count],
        torque=loop.torque[:count],
        base=loop.base[:count],
        indefinite=loop.indefinite / max(count, 1),
        torque_error=torque_error(controller.parameters.values),
        prior_torque_error=torque_error(parameter_values(prior)),
        diverged=diverged,
    )


class _Loop:
    """The closed loop with its records."""

    def __init__(self, case: Case, controller: AdaptiveController, plant: Robot) -> None:
        self._case, self._controller, self._plant = case, controller, plant
        self._dynamics = Dynamics(plant)
        size = round(case.duration / case.period) + 1
        self.attitude, self.joints = np.zeros(size), np.zeros((size, 4))
        self.torque, self.base = np.zeros((size, 7)), np.zeros((size, 10))
        self.indefinite, self.count = 0, 0
        self._rng = np.random.default_rng(case.noise_seed)

    def run(self) -> bool:
        """Run to the end; returns whether it diverged."""
        case, controller = self._case, self._controller
        task = TASKS[case.task]
        zeros = np.zeros(3)
        still = State(zeros, np.array([0.0, 0.0, 0.0, 1.0]), START, zeros, zeros, np.zeros(4))
        x = still.to_vector()
        substeps = max(1, round(case.period / _SUBSTEP))
        wrench = np.zeros(6)
        for k in range(len(self.attitude)):
            torques = controller.step(self._measure(State.from_vector(x)), task(k * case.period))
            self._record(k, torques.attitude_error, torques.joint_error)
            if max(self.attitude[k], np.max(np.abs(self.joints[k]))) > _DIVERGED:
                return True
            wrench[3:] = torques.base
            self.torque[k] = np.concatenate([torques.base, torques.joints])
            try:
                tau = torques.joints
                x = hold_step(self._dynamics, x, tau, case.period, substeps, wrench)
            except SimulationDivergedError:
                return True
        return False

    def _measure(self, state: State) -> Measured:
        sensors, scale = self._plant.sensors, self._case.noise
        omega, qd = state.omega_WB_B, state.qd
        if scale:
            omega = omega + scale * (sensors.gyro_std or 0.0) * self._rng.standard_normal(3)
            rates = self._rng.standard_normal(4)
            qd = qd + scale * (sensors.joint_velocity_std or 0.0) * rates
        v = state.v_WB_B if self._case.measures_velocity else None
        return Measured(state.q_WB_xyzw, omega, state.q, qd, v)

    def _record(self, k: int, attitude: Array, joints: Array) -> None:
        self.count = k + 1
        self.attitude[k] = np.linalg.norm(attitude)
        self.joints[k] = joints
        values = self._controller.parameters.values
        self.base[k] = values[:10]
        self.indefinite += not self._controller.health.physical
