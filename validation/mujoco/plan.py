"""What one truth run consists of, before it is built; effects edit it.

Conventions of the hidden effects (ids and parameters as in docs/effects.md, gains apart):

- gains are relative errors, the catalogue's less one: measured rate = (1 + gain) rate, torque at
  the joint = (1 + gain) of the measured one; friction is not scaled with it;
- offsets and biases are added to what the sensor says; misalignments turn the sensor, so that it
  says R(v)^T omega, and R_WB R(v) for the attitude, with R(v) the rotation vector v;
- a delay means that the sample is that much older than its stamp;
- wheel momenta are added to what the robot file believes; a lever arm counts from the base origin;
- a body added inside (payload apart) is taken out of its host, whose rigid limit is the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .model import Inertial, Link, add_disc, add_motor, add_slosh, rotation

Force = Callable[[Any], None]  # adds to the forces of a running `Simulation`
Mend = Callable[[dict[str, np.ndarray]], None]  # changes clean samples by channel, in place
EZ = (0.0, 0.0, 1.0)


@dataclass
class Plan:
    """A truth run to be.

    Args:
        links: Bodies.
        joints: Names of the measured joints.
        base: Name of the base link.
        free: Free or fixed base.
        gravity: (3,) in the inertial frame [m/s^2].
        wheels: Relative momentum by link [N m s].
        drag: Time constant of the wheels' drag by link [s].
        gain: Relative error of the torque by joint.
        motors: Motor hinge of joints that have one of their own.
        encoder_on_motor: Joints whose encoder sits on the motor.
        forces: Called at every stage.
        mends: What sensors do to their samples.
        delays: Of clocks `joints`, `effort`, `imu`, `attitude` [s].
        fastest: Highest frequency that was brought in [rad/s].
        coulomb: Dry friction by joint, for the choice of the step [N m].
    """

    links: dict[str, Link]
    joints: list[str]
    base: str
    free: bool
    gravity: np.ndarray
    wheels: dict[str, np.ndarray]
    drag: dict[str, float] = field(default_factory=dict)
    gain: dict[str, float] = field(default_factory=dict)
    motors: dict[str, str] = field(default_factory=dict)
    encoder_on_motor: set[str] = field(default_factory=set)
    forces: list[Force] = field(default_factory=list)
    mends: list[Mend] = field(default_factory=list)
    delays: dict[str, float] = field(default_factory=dict)
    fastest: float = 0.0
    coulomb: dict[str, float] = field(default_factory=dict)

    def index(self, joint: str) -> int:
        """Column of a joint."""
        return self.joints.index(joint)

    def add_delay(self, clock: str, delay: float) -> None:
        """Make a clock later."""
        self.delays[clock] = self.delays.get(clock, 0.0) + delay

    def mend(self, channel: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
        """Let a sensor say something else."""

        def apply(samples: dict[str, np.ndarray]) -> None:
            samples[channel] = change(samples[channel])

        self.mends.append(apply)


def turn(v: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(v))
    K = np.cross(np.eye(3), v)
    if angle < 1e-12:
        return np.eye(3) + K
    return np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K


# ------------------------------------------------------------------ joints


def viscous(plan: Plan, joint: str, coefficient: float) -> None:
    i = plan.index(joint)
    plan.forces.append(lambda s: s.push_joint(i, -coefficient * s.qd[i]))


def coulomb(plan: Plan, joint: str, torque: float) -> None:
    stribeck(plan, joint, torque, torque, 1.0)


def stribeck(plan: Plan, joint: str, coulomb: float, static: float, velocity: float) -> None:
    """-(c + (s - c) exp(-(v/v_s)^2)) sign(v); the sign is smoothed over `s.stiction` [rad/s]."""
    i = plan.index(joint)
    plan.coulomb[joint] = plan.coulomb.get(joint, 0.0) + max(coulomb, static)

    def force(s: Any) -> None:
        v = s.qd[i]
        size = coulomb + (static - coulomb) * np.exp(-((v / velocity) ** 2))
        s.push_joint(i, -size * np.tanh(v / s.stiction))

    plan.forces.append(force)


def torque_constant(plan: Plan, joint: str, gain: float) -> None:
    plan.gain[joint] = plan.gain.get(joint, 0.0) + gain


def ripple(plan: Plan, joint: str, amplitude: float, harmonic: float, phase: float = 0.0) -> None:
    i = plan.index(joint)
    plan.forces.append(lambda s: s.push_joint(i, amplitude * np.sin(harmonic * s.q[i] + phase)))
    plan.fastest = max(plan.fastest, harmonic)  # at 1 rad/s


def stiffness(plan: Plan, joint: str, stiffness: float, rest_angle: float = 0.0) -> None:
    i = plan.index(joint)
    plan.forces.append(lambda s: s.push_joint(i, -stiffness * (s.q[i] - rest_angle)))


def motor_inertia(plan: Plan, joint: str, inertia: float) -> None:
    for link in plan.links.values():
        for hinge in link.hinges:
            if hinge.name == joint:
                hinge.armature += inertia


def flexibility(
    plan: Plan,
    joint: str,
    stiffness: float,
    damping: float,
    rotor_inertia: float,
    encoder: str = 'link',
) -> None:
    plan.motors[joint] = add_motor(plan.links, joint, rotor_inertia, stiffness, damping)
    rates = (np.sqrt(2.0 * stiffness / rotor_inertia), damping / rotor_inertia)
    plan.fastest = max(plan.fastest, *rates)
    if encoder == 'motor':
        plan.encoder_on_motor.add(joint)


def backlash(
    plan: Plan,
    joint: str,
    gap: float,
    stiffness: float = 2e4,
    damping: float = 20.0,
    rotor_inertia: float = 2.0,
    encoder: str = 'link',
) -> None:
    """A gap (full width) between motor and link, closed by a stiff contact."""
    flexibility(plan, joint, stiffness, 0.0, rotor_inertia, encoder)
    i = plan.index(joint)
    for link in plan.links.values():
        for hinge in link.hinges:
            if hinge.name == joint:
                hinge.stiffness = 0.0

    def force(s: Any) -> None:
        angle, rate = s.spring(i)
        over = angle - np.clip(angle, -0.5 * gap, 0.5 * gap)
        if over:
            s.push_spring(i, -stiffness * over - damping * rate)

    plan.forces.append(force)


# ------------------------------------------------------------------ sensors


def _added(channel: str) -> Callable[..., None]:
    def effect(plan: Plan, joint: str, **values: float) -> None:
        ((_, value),) = values.items()
        i = plan.index(joint)
        plan.mend(channel, lambda x: x + value * (np.arange(x.shape[1]) == i))

    return effect


def _scaled(channel: str) -> Callable[..., None]:
    def effect(plan: Plan, joint: str, gain: float) -> None:
        i = plan.index(joint)
        plan.mend(channel, lambda x: x * (1.0 + gain * (np.arange(x.shape[1]) == i)))

    return effect


def gyro_bias(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    plan.mend('gyro', lambda w: w + np.array([x, y, z]))


def gyro_scale(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    plan.mend('gyro', lambda w: w * (1.0 + np.array([x, y, z])))


def gyro_misalignment(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    R = turn(np.array([x, y, z]))
    plan.mend('gyro', lambda w: w @ R)


def attitude_misalignment(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    R = turn(np.array([x, y, z]))
    plan.mend('attitude', lambda rotations: rotations @ R)


def _delay(clock: str) -> Callable[..., None]:
    return lambda plan, _, delay: plan.add_delay(clock, delay)


# ------------------------------------------------------------------ wheels


def target_wheel(plan: Plan, link: str, x: float, y: float, z: float) -> None:
    plan.wheels[link] = plan.wheels.get(link, np.zeros(3)) + np.array([x, y, z])


def servicer_wheel(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    target_wheel(plan, plan.base, x, y, z)


def target_drag(plan: Plan, link: str, time_constant: float) -> None:
    plan.drag[link] = time_constant


def servicer_drag(plan: Plan, _: None, time_constant: float) -> None:
    plan.drag[plan.base] = time_constant


def imbalance(
    plan: Plan,
    link: str | None,
    amplitude: float,
    frequency: float,
    phase: float = 0.0,
    axis: tuple[float, float, float] = EZ,
) -> None:
    """A torque that turns with a wheel: amplitude [cos, sin, 0] for a wheel about z."""
    host = link or plan.base
    a = np.asarray(axis) / np.linalg.norm(axis)
    u = np.eye(3)[int(np.argmin(np.abs(a)))]
    u = u - (a @ u) * a
    u = u / np.linalg.norm(u)
    v = np.cross(a, u)

    def force(s: Any) -> None:
        angle = frequency * s.data.time + phase
        s.push_body_torque(host, amplitude * (np.cos(angle) * u + np.sin(angle) * v))

    plan.forces.append(force)
    plan.fastest = max(plan.fastest, frequency)


def free_rotors(plan: Plan, link: str | None, inertia: float, rates: tuple[float, ...]) -> None:
    """Three free rotors along x, y, z: their axial inertia leaves the host, h counts absolute.

    Args:
        plan: The run.
        link: Host.
        inertia: Of each rotor about its axis [kg m^2].
        rates: (3,) angular rate of the host at the start, in its frame [rad/s].
    """
    host = link or plan.base
    part = Inertial(0.0, plan.links[host].inertial.com, inertia * np.eye(3))
    plan.links[host].inertial.add(part, -1.0)
    plan.wheels[host] = plan.wheels.get(host, np.zeros(3)) + inertia * np.asarray(rates)


# ------------------------------------------------------------------ bodies


def payload(
    plan: Plan,
    link: str,
    mass: float,
    com: tuple[float, float, float] = (0.0, 0.0, 0.0),
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """A body that the model doesn't know, at `com` of the link's frame; negative mass: missing."""
    part = Inertial(abs(mass), np.array(com, dtype=float), np.diag(inertia).astype(float))
    plan.links[link].inertial.add(part, float(np.sign(mass)))


def appendage(
    plan: Plan,
    link: str | None,
    frequency: float,
    damping: float,
    inertia: float,
    axis: tuple[float, float, float] = EZ,
    **boom: float | tuple[float, float, float],
) -> None:
    parts = (float(boom['mass']), np.array(boom['at']), np.array(boom['lever'])) if boom else None
    host, along = link or plan.base, np.asarray(axis, float)
    add_disc(plan.links, host, inertia, along, frequency, damping, parts)
    plan.fastest = max(plan.fastest, frequency)


def slosh(plan: Plan, link: str | None, mass: float, frequency: float, damping: float) -> None:
    add_slosh(plan.links, link or plan.base, mass, frequency, damping)
    plan.fastest = max(plan.fastest, frequency)


# ------------------------------------------------------------------ environment


def torque_body(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    torque = np.array([x, y, z])
    plan.forces.append(lambda s: s.push_body_torque(plan.base, torque))


def torque_inertial(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    torque = np.array([x, y, z])
    plan.forces.append(lambda s: s.push(plan.base, torque=torque))


def leak(
    plan: Plan, _: None, force: tuple[float, ...], at: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> None:
    f, p = np.asarray(force, float), np.asarray(at, float)

    def push(s: Any) -> None:
        R = s.rotation(plan.base)
        s.push(plan.base, force=R @ f, torque=R @ np.cross(p - s.com_in_link(plan.base), f))

    plan.forces.append(push)


def gravity_gradient(
    plan: Plan, _: None, orbital_rate: float, direction: tuple[float, ...] = (0.0, 0.0, -1.0)
) -> None:
    """The tide on every body: force n^2 m (3 r r^T - 1) rho, torque 3 n^2 r x (I r)."""
    r = np.asarray(direction, float) / np.linalg.norm(direction)
    tide = orbital_rate**2 * (3.0 * np.outer(r, r) - np.eye(3))

    def push(s: Any) -> None:
        arms = s.data.xipos - s.data.subtree_com[0]
        s.data.xfrc_applied[:, :3] += s.model.body_mass[:, None] * (arms @ tide)
        axes = s.data.ximat.reshape(-1, 3, 3)
        local = np.einsum('bji,j->bi', axes, r)
        torque = np.cross(local, s.model.body_inertia * local)
        s.data.xfrc_applied[:, 3:] += 3.0 * orbital_rate**2 * np.einsum('bij,bj->bi', axes, torque)

    plan.forces.append(push)


def gravity_error(plan: Plan, _: None, x: float, y: float, z: float) -> None:
    plan.gravity = plan.gravity + np.array([x, y, z])


EFFECTS: dict[str, Callable[..., None]] = {
    'joint_viscous_friction': viscous,
    'joint_coulomb_friction': coulomb,
    'joint_stribeck_friction': stribeck,
    'joint_torque_constant': torque_constant,
    'joint_torque_ripple': ripple,
    'joint_stiffness': stiffness,
    'joint_flexibility': flexibility,
    'joint_backlash': backlash,
    'motor_inertia': motor_inertia,
    'encoder_offset': _added('position'),
    'encoder_scale': _scaled('position'),
    'joint_rate_scale': _scaled('velocity'),
    'torque_sensor_bias': _added('effort'),
    'gyro_bias': gyro_bias,
    'gyro_scale': gyro_scale,
    'gyro_misalignment': gyro_misalignment,
    'attitude_misalignment': attitude_misalignment,
    'imu_delay': _delay('imu'),
    'attitude_delay': _delay('attitude'),
    'joint_delay': _delay('joints'),
    'effort_delay': _delay('effort'),
    'target_wheel_momentum': target_wheel,
    'servicer_wheel_momentum_error': servicer_wheel,
    'target_wheel_drag': target_drag,
    'servicer_wheel_drag': servicer_drag,
    'wheel_imbalance': imbalance,
    'free_wheel_rotors': free_rotors,
    'inertial_parameters': payload,
    'flexible_appendage': appendage,
    'fuel_slosh': slosh,
    'external_torque_body': torque_body,
    'external_torque_inertial': torque_inertial,
    'thruster_leak': leak,
    'gravity_gradient': gravity_gradient,
    'gravity_error': gravity_error,
}

__all__ = ['EFFECTS', 'Plan', 'rotation', 'turn']
