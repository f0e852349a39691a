"""An arm on the ground as real ones are, for tests and campaigns: torques by Pinocchio.

What its file does not say, and no cause of the catalogue is, as measured on industrial arms
(docs/real_machines.md): links off by some percent and a centimetre, friction whose level is
another one in every run and drifts, ripple of the gears, a leftover of several seconds' memory,
and torques that are filtered before they are logged. No code is shared with what diagnoses it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from scipy.signal import butter, lfilter, sosfiltfilt

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.types import Array, BoolArray

from ..urdf import chain

RATE, DURATION = 100.0, 24.0  # Hz, s
JOINTS = tuple(f'joint_{k}' for k in range(1, 7))
_LINKS = (  # origin [m], axis; centre of mass [m], mass [kg], moments about it [kg m^2]; N m
    ('0 0 0.18', 'z', '0.0 0.02 -0.03', 7.4, '0.034 0.035 0.022', 330),
    ('0 0.17 0', 'y', '0.0 0.0 0.25', 13.0, '0.42 0.43 0.045', 330),
    ('0 -0.13 0.61', 'y', '0.0 0.0 0.22', 4.0, '0.12 0.12 0.012', 330),
    ('0 0 0.57', 'y', '0.0 0.06 0.0', 2.0, '0.006 0.005 0.006', 330),
    ('0 0.12 0', 'z', '0.0 0.0 0.06', 2.0, '0.006 0.006 0.005', 330),
    ('0 0 0.12', 'y', '0.0 0.04 0.0', 0.6, '0.0006 0.0004 0.0006', 330),
)
COULOMB = np.array([20.5, 18.7, 7.4, 3.0, 3.3, 2.8])  # N m
VISCOUS = np.array([27.0, 19.0, 11.0, 3.2, 2.7, 3.3])  # N m s/rad
POSE = np.array([0.0, -1.2, 1.5, -1.8, -1.5, 0.0])  # rad
_FASTEST = np.array([1.2, 1.0, 1.3, 1.6, 1.6, 1.8])  # rad/s
_HARMONICS, _SLOWEST = 5, 0.1  # of a motion, [Hz]

# what no cause is; shares of the Coulomb torque where not said otherwise
_WANDER = {8.0: 0.06, 1.0: 0.06, 0.3: 0.06}  # by its memory [s]
_BY_RUN, _DRIFT, _DRIFT_TIME = 0.05, 0.05, 20.0  # of friction; [s]
_RIPPLE, _TEETH = 0.03, 200
_MASS, _PLACE, _GAIN = 0.03, 0.01, 0.02  # of a mass; of its centre [m]; of a torque constant
_CREEP = 2e-3  # rad/s over which friction changes its sign, as in the file
_ENCODER, _EFFORT = 2e-5, 5e-3  # rad; share of the Coulomb torque
_FILTER = 20.0  # Hz


def arm_urdf() -> str:
    """URDF text of the file."""
    return chain(_LINKS, reach=6.3)


def arm_file(*, has_friction: bool = True, **robot: object) -> RobotFile:
    """What the arm's maker says of it.

    Args:
        has_friction: Whether the file has the usual friction of all joints.
        robot: Further entries of section `robot`.
    """
    own = {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81], 'joints': list(JOINTS)}
    settings = parse_settings({'robot': own | robot})
    friction = zip(JOINTS, COULOMB.tolist(), VISCOUS.tolist(), strict=True)
    believed = [
        CATALOGUE[kind](name=f'{kind}_{joint}', where=joint, values=values)
        for joint, dry, wet in friction
        for kind, values in (
            ('joint_coulomb_friction', {'torque': dry}),
            ('joint_viscous_friction', {'coefficient': wet}),
        )
    ]
    return RobotFile(
        build_robot(settings, arm_urdf()), settings, tuple(believed if has_friction else ())
    )


@dataclass(frozen=True, slots=True, eq=False)
class JointAxis:
    """What a joint does: (N,) angle [rad], rate, acceleration and motor torque [N m]."""

    q: Array
    qd: Array
    qdd: Array
    torque: Array

    @property
    def direction(self) -> Array:
        """(N,) sign of the rate, as friction has it."""
        return np.tanh(self.qd / _CREEP)


_DRIVE: dict[str, Callable[[JointAxis, Effect], Array]] = {
    'joint_coulomb_friction': lambda x, e: x.torque + e['torque'] * x.direction,
    'joint_viscous_friction': lambda x, e: x.torque + e['coefficient'] * x.qd,
    'joint_load_friction': lambda x, e: (
        x.torque / (1.0 - e['coefficient'] * x.direction * np.sign(x.torque))
    ),
    'joint_stiffness': lambda x, e: x.torque + e['stiffness'] * (x.q - e['rest_angle']),
    'joint_torque_ripple': lambda x, e: (
        x.torque - e['amplitude'] * np.sin(e['harmonic'] * x.q + e['phase'])
    ),
    'motor_inertia': lambda x, e: x.torque + e['inertia'] * x.qdd,
    'joint_torque_constant': lambda x, e: x.torque / e['gain'],
    'torque_sensor_bias': lambda x, e: x.torque + e['bias'],
}
"""Torque that is measured with an effect, from the one without; the order matters."""

HIDDEN = (*_DRIVE, 'encoder_offset', 'effort_delay', 'gravity_error', 'inertial_parameters')
"""Ids of what can be hidden in the arm."""


@dataclass(frozen=True, eq=False)
class RealArm:
    """One machine of the kind that the file describes.

    Args:
        seed: Of the machine.
        hidden: What is wrong with it.
        leftover: Factor on all that no cause is; 0: the file is right.
    """

    seed: int
    hidden: Sequence[Effect] = ()
    leftover: float = 1.0

    def record(
        self,
        run: int,
        moving: Sequence[str] = JOINTS,
        duration: float = DURATION,
        motion: int | None = None,
    ) -> Record:
        """A recording.

        Args:
            run: Seed of what differs from run to run, and of its motion.
            moving: Joints that move; the others stand.
            duration: [s].
            motion: Seed of a motion that is repeated; None: that of the run.
        """
        rng = np.random.default_rng([self.seed, run, 5])
        course = rng if motion is None else np.random.default_rng([self.seed, motion, 6])
        time = np.arange(round(duration * RATE) + 1) / RATE
        q, qd, qdd = motion_of(course, time, np.isin(JOINTS, moving))
        torque = self._motor(rng, q, qd, qdd)
        for effect in sorted(self.hidden, key=lambda e: HIDDEN.index(e.id)):
            if effect.id in _DRIVE:
                j = JOINTS.index(str(effect.where))
                axis = JointAxis(q[:, j], qd[:, j], qdd[:, j], torque[:, j])
                torque[:, j] = _DRIVE[effect.id](axis, effect)
            elif effect.id == 'encoder_offset':
                q[:, JOINTS.index(str(effect.where))] += effect['offset']
            elif effect.id == 'effort_delay':
                late = time - effect['delay']
                torque = np.column_stack([np.interp(late, time, x) for x in torque.T])
        torque = sosfiltfilt(butter(2, _FILTER, fs=RATE, output='sos'), torque, axis=0)
        torque = torque + _EFFORT * COULOMB * rng.standard_normal(torque.shape)
        q = q + _ENCODER * rng.standard_normal(q.shape)
        series = JointSeries(JOINTS, to_stamps(time), q, None, torque)
        return Record(joints=series, source=f'arm {self.seed}, run {run}')

    @cached_property
    def model(self) -> pin.Model:
        """The machine's bodies, which are not quite the file's, with the hidden ones."""
        model = pin.buildModelFromXML(arm_urdf())
        rng = np.random.default_rng([self.seed, 3])
        for joint in range(1, model.njoints):
            body = model.inertias[joint]
            off = self.leftover * rng.standard_normal(4)
            mass, lever = body.mass * (1.0 + _MASS * off[0]), body.lever + _PLACE * off[1:]
            model.inertias[joint] = pin.Inertia(mass, lever, body.inertia * mass / body.mass)
        model.gravity.linear = np.array([0.0, 0.0, -9.81])
        for effect in self.hidden:
            if effect.id == 'gravity_error':
                model.gravity.linear = model.gravity.linear + effect.vector()
            elif effect.id == 'inertial_parameters':
                joint = int(str(effect.where).removeprefix('link_'))
                whole = model.inertias[joint].toDynamicParameters()
                whole = whole + np.array(list(effect.values.values()))
                model.inertias[joint] = pin.Inertia.FromDynamicParameters(whole)
        return model

    def _motor(self, rng: np.random.Generator, q: Array, qd: Array, qdd: Array) -> Array:
        """(N, n) torques with all that no cause is [N m]."""
        data, share = self.model.createData(), self.leftover * COULOMB
        states = zip(q, qd, qdd, strict=True)
        rigid = np.array([pin.rnea(self.model, data, *state) for state in states])
        direction = np.tanh(qd / _CREEP)
        level = _BY_RUN * rng.standard_normal(6) + _DRIFT * _wandering(rng, len(q), _DRIFT_TIME)
        torque = rigid + COULOMB * direction + VISCOUS * qd + share * level * direction
        for memory, size in _WANDER.items():
            torque += share * size * _wandering(rng, len(q), memory)
        torque += share * _RIPPLE * np.sin(_TEETH * q + rng.uniform(0.0, 2.0 * np.pi, 6))
        gains = np.random.default_rng([self.seed, 4]).standard_normal(6)
        return torque * (1.0 + self.leftover * _GAIN * gains)


def motion_of(
    rng: np.random.Generator, time: Array, is_moving: BoolArray
) -> tuple[Array, Array, Array]:
    """(N, n) angles, rates and accelerations: sums of sines, as excitations of robots are."""
    w = 2.0 * np.pi * _SLOWEST * np.arange(1, _HARMONICS + 1)
    size, turn = rng.standard_normal((2, 6, _HARMONICS))
    angle = time[:, None] * w
    sine, cosine = np.sin(angle), np.cos(angle)
    qd = cosine @ size.T + sine @ turn.T
    scale = is_moving * _FASTEST / np.max(np.abs(qd), axis=0)
    q = (sine / w) @ size.T - (cosine / w) @ turn.T
    qdd = (-sine * w) @ size.T + (cosine * w) @ turn.T
    return POSE + scale * q, scale * qd, scale * qdd


def _wandering(rng: np.random.Generator, count: int, memory: float) -> Array:
    """(count, n) Ornstein-Uhlenbeck processes of unit variance and this memory [s]."""
    keep = np.exp(-1.0 / (RATE * memory))
    drive = rng.standard_normal((count, 6)) * np.sqrt(1.0 - keep**2)
    drive[0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))
