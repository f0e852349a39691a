"""The wheel-momentum identification paper: what it prints, its experiment, and noisy records.

The paper prints neither its joint axes nor its condition numbers nor its noise levels nor its
gains; the references below are of an independent prototype, for the readings that fit. Its noise
models are in a reference that we do not have; nominal here is a realistic level, and scale 0.1 is
where plain least squares makes the errors that the paper prints
(validation/results/reproduction.md).

Motions come in two kinds. *Momentum-integrated*: joints follow the reference exactly, body rate
and attitude from the conservation of momentum; then the paper's linear system is an identity,
whatever the integrator's error. *Forward integrated*: the plant is driven by torques, and nothing
but the equations of motion makes momentum constant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from spacerobot_ros.control.command import Feedback
from spacerobot_ros.control.computed_torque import ComputedTorque, Model, robot_model
from spacerobot_ros.control.joint_reference import Reference as JointReference
from spacerobot_ros.control.joint_reference import build_reference
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State, initial_state
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.trajectory.base_response import BaseResponse, BaseStart
from spacerobot_ros.estimation.trajectory.reference import Kinematics, NoiseLevels
from spacerobot_ros.estimation.unknowns.minimal import MinimalSet, minimal_set
from spacerobot_ros.model.files import read_yaml
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.types import Array
from validation.smooth_motion import TorqueOf, simulate_smooth

from ..hidden.diagnosis_scenario import packaged

TARGET_MOMENTUM = (42.0, 49.0, 41.0)  # N m s, section IV
SAMPLES, SAMPLE_PERIOD = 1000, 0.02  # "N = 1000" of 20 s; the printed 50 ms does not fit
UNKNOWNS = 22  # rows of Table III: 3 wheel momenta and k = 19
TABLE_SCALE = 0.1  # of our noise, where least squares makes errors as large as those in Table III
TRACKING_ERROR_DEG, TRACKING_ERROR_M = 8.0, 0.9  # Figs 6 and 7, without knowledge of the wheels


_PRINTED = read_yaml(Path(__file__).with_name('printed.yaml'), 'printed')
TABLE_III, CONDITION_REFERENCE = _PRINTED['table_iii'], _PRINTED['condition']
BOUND_REFERENCE = _PRINTED['bound']
LARGEST_EXACT: float = max(map(abs, TABLE_III['exact']))
TRACKING_ERRORS = ('max_joint_error_deg', 'max_end_effector_error_m')


def tracking_reference(
    axes: str, plant: str, law: str, bandwidth: float
) -> dict[str, float] | None:
    """Largest errors of the prototype; None where it has none."""
    found = _PRINTED['tracking'].get(f'{axes} {plant} {law}', {}).get(bandwidth)
    return found and dict(zip(TRACKING_ERRORS, found, strict=True))


def estimator_reference(axes: str, scale: float, method: str) -> tuple[float, float] | None:
    """RMSE of the AAM over the linear set's bound, and |bias| / RMSE; None as above."""
    return _PRINTED['estimators'].get(f'{axes} {method}', {}).get(scale)


STARTS = ('moving', 'wheels', 'spin_up')
"""moving: eqs. (27)-(28); wheels: robot at rest, all wheels spinning (Y_in = 0); spin_up: eqs.
(31)-(32), robot at rest, then the servicer's own wheels are spun up and turn the base."""

_AXES = {'x': (1.0, 0.0, 0.0), 'y': (0.0, 1.0, 0.0), 'z': (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Scenario:
    """The servicer with given joint axes.

    Args:
        axes: Axis letter of each joint, such as `zyx`.
        believed: What the robot file believes: the captured wheels at rest.
        robot: The truth.
        reference: Table II's motion.
        initial: First state of the `moving` start, centre of mass at rest.
        identifier: Settings of the identifier.
    """

    axes: str
    believed: Robot
    robot: Robot
    reference: JointReference
    initial: State
    identifier: IdentifierSettings

    @property
    def times(self) -> Array:
        """(1000,) sample times [s]."""
        return np.array([SAMPLE_PERIOD * k for k in range(SAMPLES)])

    @cached_property
    def dynamics(self) -> Dynamics:
        """Dynamics of the true robot."""
        return Dynamics(self.robot)

    @cached_property
    def minimal(self) -> MinimalSet:
        """Minimal set with the symmetry of Table I."""
        return minimal_set(self.robot, 'symmetric')

    def start(self, kind: str) -> State:
        """First state of one of `STARTS`, just after the wheels are spun up."""
        if kind not in STARTS:
            raise ConfigurationError('start', f'{kind!r} is not one of {", ".join(STARTS)}')
        omega = self.initial.omega_WB_B
        if kind == 'wheels':
            omega = np.zeros(3)
        elif kind == 'spin_up':
            h0 = self.robot.servicer_wheels.body_momentum
            omega = BaseResponse(self.robot).spun_up(self.initial.q, h0)
        return self.dynamics.at_rest_centre(replace(self.initial, omega_WB_B=omega))


@lru_cache(maxsize=8)
def scenario(axes: str) -> Scenario:
    """The paper's experiment with given joint axes, one letter of x, y, z a joint.

    Raises:
        ConfigurationError: not three of these letters.
    """
    if len(axes) != 3 or set(axes) - set(_AXES):
        raise ConfigurationError('axes', f'{axes!r} is not three letters of x, y, z')
    file = packaged('servicer')
    bodies = file.robot.bodies
    turned = (
        replace(body, axis=np.array(_AXES[axis]))
        for body, axis in zip(bodies[1:], axes, strict=True)
    )
    believed = replace(file.robot, bodies=(bodies[0], *turned))
    robot = believed.with_target_momentum(np.array(TARGET_MOMENTUM))
    initial = Dynamics(robot).at_rest_centre(initial_state(robot, file.settings.initial))
    reference = build_reference(file.settings.reference, initial.q)
    return Scenario(axes, believed, robot, reference, initial, file.settings.identifier)


@lru_cache(maxsize=16)
def momentum_motion(axes: str, start: str = 'moving') -> Kinematics:
    """Motion along the exact reference, body rate from the momentum at every sample."""
    case = scenario(axes)
    state, points = case.start(start), [case.reference.at(float(t)) for t in case.times]
    q, qd, qdd = (np.array([[getattr(p, name) for p in points]]) for name in ('q', 'qd', 'qdd'))
    first = BaseStart(state.q_WB_xyzw, state.omega_WB_B)
    base = BaseResponse(case.robot).move(case.times, q, qd, qdd, first)
    return Kinematics(case.times, q[0], qd[0], base.omega[0], Rotation.from_matrix(base.R_WB[0]))


def forward_motion(case: Scenario, start: str = 'moving', rtol: float = 1e-13) -> Kinematics:
    """Motion of the plant under the corrected law, by error-controlled integration."""
    torque = continuous_torque(case, robot_model(case.robot), 1.0)
    states = simulate_smooth(
        case.dynamics, case.start(start).to_vector(), torque, case.times, rtol, 0.1 * rtol
    )
    return Kinematics(
        case.times,
        states[:, 7:10],
        states[:, 16:19],
        states[:, 13:16],
        Rotation.from_quat(states[:, 3:7]),
    )


def continuous_torque(case: Scenario, model: Model, bandwidth: float) -> TorqueOf:
    """Computed torque without limits, for an integrator to call at every stage.

    Args:
        case: Its reference is followed.
        model: What the law knows of the robot.
        bandwidth: Double pole of the error dynamics [rad/s].
    """
    law = ComputedTorque(model, bandwidth, np.full(3, np.inf))

    def torque(t: float, x: Array) -> Array:
        s = State.from_vector(x)
        return law.track(case.reference, t, Feedback(s.q, s.qd, s.omega_WB_B, np.zeros(3))).tau

    return torque


NOMINAL = {
    'joint_position': 1e-4,  # rad
    'joint_velocity': 1e-3,  # rad/s
    'gyro': 1e-4,  # rad/s
    'attitude': 1e-4,  # rad
}
SCALES = (1.0, 0.1)


def noise_of(scale: float) -> SensorSettings:
    """The nominal noise times a factor."""
    return SensorSettings(**{f'{name}_std': scale * std for name, std in NOMINAL.items()})


def levels_of(scale: float) -> NoiseLevels:
    """The same as the momentum filter takes it; efforts are not measured."""
    stds = {name: scale * std for name, std in NOMINAL.items()}
    return NoiseLevels(**stds, joint_effort=np.inf)


def noisy_record(
    joints: tuple[str, ...], motion: Kinematics, scale: float, seed: int, attitude_every: int = 1
) -> Record:
    """The motion as the sensors see it.

    Args:
        joints: Joint names.
        motion: Noise-free samples.
        scale: Factor on the nominal noise.
        seed: Of the noise.
        attitude_every: Samples from one attitude to the next.
    """
    rng = np.random.default_rng(seed)
    stamps = np.round(motion.time * 1e9).astype(np.int64)
    q, qd, omega, turn = (
        scale * std * rng.standard_normal(like.shape)
        for std, like in zip(
            NOMINAL.values(), (motion.q, motion.qd, motion.omega, motion.omega), strict=True
        )
    )
    attitude = (motion.rotation * Rotation.from_rotvec(turn)).as_quat()
    return Record(
        JointSeries(joints, stamps, motion.q + q, motion.qd + qd),
        RateSeries(stamps, motion.omega + omega),
        AttitudeSeries(stamps[::attitude_every], attitude[::attitude_every]),
        source=f'noise scale {scale:g}, seed {seed}',
    )
