"""Motions: where a run starts, what a controller follows, what a design of a motion may do."""

from __future__ import annotations

from dataclasses import dataclass

from .schema import TIMES, FloatList, param


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSettings:
    """The motion that the controller follows.

    The attitude counts for the laws that control it: passivity and the adaptive ones. They hold
    the attitude at the start where nothing else is said.

    Args:
        kind: hold; fourier: around the start; set_point: a smooth move; step: the goal at once;
            harmonic: sines around the start, for ever; topic: hold until /reference comes.
        duration: Duration of one pass of the Fourier motion or of the move; period of the
            harmonics.
        harmonics: Number of Fourier harmonics.
        sine: Coefficients a of sin/(w l), joint by joint, harmonics inside.
        cosine: Coefficients b of -cos/(w l), joint by joint, harmonics inside.
        set_point: Goal of `set_point` and `step`, one a joint.
        amplitude: Amplitude of `harmonic`, one a joint.
        attitude_xyzw: Goal q_WB of `set_point` and `step`, normalized within 1e-3; empty: as it
            is.
        attitude_amplitude: Rotation vector of `harmonic`, in base coordinates at the start; empty:
            none.
        repeat: Start the Fourier motion again when it ends, instead of holding.
    """

    kind: str = param(
        'hold', choices=('hold', 'fourier', 'set_point', 'step', 'harmonic', 'topic')
    )
    duration: float = param(20.0, 's', **TIMES)
    harmonics: int = param(3, minimum=1, maximum=20)
    sine: FloatList = param((), 'rad/s')
    cosine: FloatList = param((), 'rad/s')
    set_point: FloatList = param((), 'rad')
    amplitude: FloatList = param((), 'rad')
    attitude_xyzw: FloatList = param(())
    attitude_amplitude: FloatList = param((), 'rad')
    repeat: bool = param(False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSettings:
    """Design of an identification motion (`spacerobot excite`): family, limits, search.

    A joint limit is one number for all joints or one a joint. The URDF's position limits hold
    besides.

    Args:
        duration: Duration of the motion.
        harmonics: Number of Fourier harmonics a joint.
        start: Base rate at the start: initial.angular_velocity; rest; spin_up: at rest, then the
            servicer's wheels are spun up; auto: initial where base_rate and base_rotation allow
            it, else rest.
        joint_range: Largest joint angle; 175 deg.
        joint_rate: Largest joint rate; the URDF's velocity limits hold besides.
        joint_acceleration: Largest joint acceleration; empty: no limit.
        joint_torque: Largest joint torque; 90 % of the URDF's effort limits hold besides.
        base_rotation: Largest turn of the base from its first attitude.
        base_rate: Largest rate of the base, such that trackers see.
        momentum_uncertainty: Limits hold also where an axis of the captured wheels' momentum is
            off by this.
        criterion: information: bits told of the whole estimate; condition: the paper's condition
            number; unit_condition: the same with columns of unit norm.
        starts: Number of starting points.
        iterations: Largest number of steps a start.
        seed: Seed of the starting points.
    """

    duration: float = param(20.0, 's', **TIMES)
    harmonics: int = param(3, minimum=1, maximum=20)
    start: str = param('auto', choices=('auto', 'initial', 'rest', 'spin_up'))
    joint_range: FloatList = param((3.0543261909900763,), 'rad', above=0.0)
    joint_rate: FloatList = param((), 'rad/s', above=0.0)
    joint_acceleration: FloatList = param((), 'rad/s^2', above=0.0)
    joint_torque: FloatList = param((), 'N m', above=0.0)
    base_rotation: float | None = param(None, 'rad', above=0.0)
    base_rate: float | None = param(None, 'rad/s', above=0.0)
    momentum_uncertainty: float = param(0.0, 'N m s', minimum=0.0)
    criterion: str = param('information', choices=('information', 'condition', 'unit_condition'))
    starts: int = param(3, minimum=1, maximum=1000)
    iterations: int = param(80, minimum=1, maximum=10000)
    seed: int = param(1, minimum=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialSettings:
    """State at the start of a simulation.

    Args:
        attitude_xyzw: q_WB, normalized within 1e-3.
        angular_velocity: omega_WB_B.
        joint_position: Joint positions; zero where empty.
        joint_velocity: Joint rates; zero where empty.
    """

    attitude_xyzw: FloatList = param((0.0, 0.0, 0.0, 1.0), length=4)
    angular_velocity: FloatList = param((0.0, 0.0, 0.0), 'rad/s', length=3)
    joint_position: FloatList = param((), 'rad')
    joint_velocity: FloatList = param((), 'rad/s')
