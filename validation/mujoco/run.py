"""Runs a truth plan in MuJoCo: motions, control, and the state at every step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from ..replay.machines import Machine
from ..replay.plant import Motion
from .plan import Plan

ATTITUDE = np.array([0.2, 0.1, 0.3, 0.927]) / np.linalg.norm([0.2, 0.1, 0.3, 0.927])  # xyzw
STICTION = 2e-3  # rad/s: dry friction changes its sign over this rate, or over what the step needs


@dataclass(frozen=True)
class Excitation:
    """A motion from rest, and how the controller makes the robot follow it.

    Args:
        amplitude: Peak of each joint's motion [rad].
        period: Of the slowest harmonic [s].
        harmonics: Number of harmonics, with random weights.
        control: `smooth` (continuous in time) or `held` (over each control period).
        measured: Whether the controller sees what the sensors say, with noise, faults and delays.
        bandwidth: Of the controller [rad/s].
        period_control: Control period [s].
    """

    amplitude: float = 0.4
    period: float = 20.0
    harmonics: int = 3
    control: str = 'smooth'
    measured: bool = False
    bandwidth: float = 3.0
    period_control: float = 0.01


EXCITATIONS = {
    'default': Excitation(),
    'quiet': Excitation(amplitude=0.1),
    'fast': Excitation(amplitude=0.8, period=8.0),
    'slow': Excitation(period=40.0),
    'held': Excitation(control='held'),
    'measured': Excitation(control='held', measured=True),
}


class Reference:
    """q0 + sum a_k (1 - cos k W t) + b_k (sin k W t - k sin W t): starts at rest at q0."""

    def __init__(self, q0: np.ndarray, excitation: Excitation, rng: np.random.Generator) -> None:
        k = np.arange(1, excitation.harmonics + 1)
        self.q0, self.k = q0, k
        self.rate = 2.0 * math.pi / excitation.period
        weights = rng.standard_normal((2, len(q0), len(k))) / k
        self.a, self.b = weights
        t = np.linspace(0.0, excitation.period, 200)
        peak = np.max(np.abs(self.at(t)[:, 0] - q0), axis=0)
        self.a, self.b = weights * (excitation.amplitude / peak)[None, :, None]

    def at(self, times: np.ndarray) -> np.ndarray:
        """(N, 3, n): position, rate, acceleration at N times."""
        w, k = self.rate, self.k
        c, s = np.cos(np.outer(times, k * w)), np.sin(np.outer(times, k * w))
        q = self.q0 + (1.0 - c) @ self.a.T + (s - s[:, :1] * k) @ self.b.T
        qd = w * ((k * s) @ self.a.T + (k * (c - c[:, :1])) @ self.b.T)
        qdd = w * w * ((k * k * c) @ self.a.T - (k * k * s - k * s[:, :1]) @ self.b.T)
        return np.stack([q, qd, qdd], axis=1)


@dataclass
class History:
    """State at every step: time (N,), q, qd, torque (N, n); attitude wxyz (N, 4), omega (N, 3)."""

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    motor_q: np.ndarray
    motor_qd: np.ndarray
    torque: np.ndarray
    attitude: np.ndarray
    omega: np.ndarray


Seen = Callable[[int, 'Simulation'], tuple[np.ndarray, np.ndarray]]


class Simulation(Motion):
    """A plan that moves; forces are asked for at every Runge-Kutta stage.

    `q` and `v` are places of the motors in MuJoCo's state; `angle` and `rate` (n,) are of joints.
    """

    def __init__(self, plan: Plan, dt: float) -> None:
        super().__init__(plan)
        flags = mujoco.mjtDisableBit
        self.model.opt.timestep = dt
        self.model.opt.disableflags |= flags.mjDSBL_CONSTRAINT | flags.mjDSBL_AUTORESET
        self._springs = [plan.joints.index(j) for j in plan.joints if j in plan.motors]
        self._q_spring, self._v_spring = self.q[self._springs], self.v[self._springs]
        motors = [self.model.joint(plan.motors.get(j, {}).get('name', j)).id for j in plan.joints]
        self.q, self.v = self.model.jnt_qposadr[motors], self.model.jnt_dofadr[motors]
        self.angle = self.rate = np.zeros(len(plan.joints))
        self.stiction = STICTION

    def push_joint(self, i: int, torque: float) -> None:
        """A torque between a joint's parent and its link."""
        self.data.qfrc_passive[self.v[i]] += torque
        if i in self._springs:
            self.data.qfrc_passive[self._v_spring[self._springs.index(i)]] += torque

    def stage(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """What MuJoCo asks for at every stage, once it knows passive forces and bias."""
        self.angle, self.rate = data.qpos[self.q], data.qvel[self.v]
        if self._springs:
            self.angle[self._springs] += data.qpos[self._q_spring]
            self.rate[self._springs] += data.qvel[self._v_spring]
        super().stage(model, data)

    def inertia(self) -> np.ndarray:
        """(n, n) joint inertia with the base free to react and the motors' springs locked."""
        mujoco.mj_forward(self.model, self.data)
        M = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, M)
        free = np.setdiff1d(np.arange(self.model.nv), self._v_spring)
        inverse = np.linalg.inv(M[np.ix_(free, free)])
        motors = np.searchsorted(free, self.v)
        return np.linalg.inv(inverse[np.ix_(motors, motors)])

    def place(self, q: np.ndarray, attitude_xyzw: np.ndarray, omega: np.ndarray) -> None:
        """Joints at rest, the base turning."""
        self.data.qpos[self.q] = q
        if self.plant.free:
            self.data.qpos[3:7] = np.roll(attitude_xyzw, 1)
            self.data.qvel[3:6] = omega

    def run(self, steps: int, every: int, control: Callable[[int], None]) -> History:
        """Integrate.

        Args:
            steps: Number of steps.
            every: Steps a control period; `control(k)` is called at its begin.
            control: Sets `torque`.
        """
        n, d, at_rest = len(self.plant.joints), self.data, np.zeros(3)
        rows = np.empty((steps + 1, 1 + 5 * n + 7))
        mujoco.set_mjcb_control(self.stage)
        try:
            for k in range(steps + 1):
                mujoco.mj_forward(self.model, self.data)
                # the torque is of the step that ended, where it is held
                parts = (self.angle, self.rate, d.qpos[self.q], d.qvel[self.v], self.applied)
                base = (d.qpos[3:7], d.qvel[3:6]) if self.plant.free else ((1.0, 0, 0, 0), at_rest)
                rows[k] = np.concatenate([[d.time], *parts, *base])
                if k % every == 0:
                    control(k // every)
                mujoco.mj_step(self.model, self.data)
        finally:
            mujoco.set_mjcb_control(None)
        parts = np.split(rows, np.cumsum([1, n, n, n, n, n, 4]), axis=1)
        if not np.all(np.isfinite(rows)):
            raise ArithmeticError('the truth diverged')
        return History(parts[0][:, 0], *parts[1:])


def step_size(plan: Plan, inertia: np.ndarray, period: float) -> float:
    """Step that resolves what was brought in, a whole part of the control period [s]."""
    wanted = 5e-3
    if plan.fastest > 0.0:
        wanted = min(wanted, 0.25 / plan.fastest)
    least = dict(zip(plan.joints, np.diag(np.linalg.inv(inertia)), strict=True))
    for joint, torque in plan.dry.items():
        wanted = min(wanted, 2.0 * STICTION / (torque * least[joint]))
    return period / math.ceil(period / max(wanted, 1e-4))


def _inertias(trial: Simulation, times: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(N, n, n) joint inertia along a motion: exact at knots, a spline between them."""
    knots = np.linspace(0, len(times) - 1, 200).astype(int)
    matrices = []
    for k in knots:
        trial.data.qpos[trial.q] = q[k]
        matrices.append(trial.inertia())
    return CubicSpline(times[knots], matrices)(times)


def simulate(
    plan: Plan,
    machine: Machine,
    excitation: Excitation,
    duration: float,
    rng: np.random.Generator,
    seen: Seen,
) -> History:
    """Follow a motion.

    Args:
        plan: The robot and what it hides.
        machine: Where it starts.
        excitation: Motion and control.
        duration: [s].
        rng: For the motion.
        seen: What the controller is told at control period k: positions and rates.
    """
    start = machine.q0, ATTITUDE, np.array(machine.omega)
    trial = Simulation(plan, 1e-3)
    trial.place(*start)
    H = trial.inertia()
    dt = step_size(plan, H, excitation.period_control)
    sim = Simulation(plan, dt)
    sim.place(*start)
    least = dict(zip(plan.joints, np.diag(np.linalg.inv(H)).tolist(), strict=True))
    widths = (0.5 * dt * torque * least[j] for j, torque in plan.dry.items())
    sim.stiction = max([STICTION, *widths])
    b = excitation.bandwidth
    halves = np.arange(2 * round((duration + 2.0 * excitation.period_control) / dt)) * 0.5 * dt
    reference = Reference(machine.q0, excitation, rng).at(halves)  # stages fall on half steps
    inertias = _inertias(trial, halves, reference[:, 0])

    def law(t: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        half = round(2.0 * t / dt)
        want, rate, acceleration = reference[half]
        bias = 0.0 if plan.free else sim.data.qfrc_bias[sim.v]
        return inertias[half] @ (acceleration + 2.0 * b * (rate - qd) + b * b * (want - q)) + bias

    def control(k: int) -> None:
        if excitation.control == 'smooth':
            return
        told = (
            seen(k, sim) if excitation.measured and seen else (sim.angle.copy(), sim.rate.copy())
        )
        # The torque of the period's middle: what is held then leads and lags by the same half.
        tau = law(sim.data.time + 0.5 * excitation.period_control, *told)
        sim.torque = lambda: tau

    if excitation.control == 'smooth':
        sim.torque = lambda: law(sim.data.time, sim.angle, sim.rate)
    every = round(excitation.period_control / dt)
    return sim.run(round(duration / dt), every, control)
