"""The paper's experiment: robot of Table I with any joint axes, motion of Table II, three starts.

Motions come in two kinds. *Momentum-integrated*: joints follow the reference exactly, body rate
and attitude from the conservation of momentum; then the paper's linear system is an identity,
whatever the integrator's error. *Forward integrated*: the plant is driven by torques, and nothing
but the equations of motion makes momentum constant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from ..control.feedback import Feedback
from ..control.joint_reference import Reference as JointReference
from ..control.joint_reference import build_reference
from ..control.laws import ComputedTorque, Model, robot_model
from ..dynamics.equations import Dynamics
from ..dynamics.integrate import Torque, simulate_smooth
from ..dynamics.state import State, initial_state
from ..errors import ConfigurationError
from ..estimation.minimal import MinimalSet, minimal_set
from ..estimation.reference import Kinematics
from ..excitation.base_response import BaseResponse, BaseStart
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..types import Array
from . import paper
from .packaged_robots import packaged

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
        return np.array([paper.SAMPLE_PERIOD * k for k in range(paper.SAMPLES)])

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
    robot = believed.with_target_momentum(np.array(paper.TARGET_MOMENTUM))
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


def continuous_torque(case: Scenario, model: Model, bandwidth: float) -> Torque:
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
