"""The motion to follow and the controller that follows it."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import FloatList
from .parameter import param

ADAPTIVE_LAWS = (
    'passivity',
    'adaptive_rls',
    'adaptive_lyapunov',
    'adaptive_composite',
    'adaptive_rls_paper',
    'adaptive_lyapunov_paper',
)
COMPUTED_TORQUE_LAWS = ('computed_torque', 'computed_torque_no_aam', 'computed_torque_paper')
CONSISTENCIES = ('none', 'project', 'natural')


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSettings:
    """The motion that the controller follows.

    The attitude counts for the laws that control it: passivity and the adaptive ones. They hold
    the attitude at the start where nothing else is said.
    """

    kind: str = param(
        'hold',
        choices=('hold', 'fourier', 'set_point', 'step', 'harmonic', 'topic'),
        doc='hold; fourier: around the start; set_point: a smooth move; step: the goal at once; '
        'harmonic: sines around the start, for ever; topic: hold until /reference comes.',
    )
    duration: float = param(
        20.0,
        unit='s',
        above=0.0,
        doc='Duration of one pass of the Fourier motion or of the move; period of the harmonics.',
    )
    harmonics: int = param(3, minimum=1, maximum=20, doc='Number of Fourier harmonics.')
    sine: FloatList = param(
        (), unit='rad/s', doc='Coefficients a of sin/(w l), joint by joint, harmonics inside.'
    )
    cosine: FloatList = param(
        (), unit='rad/s', doc='Coefficients b of -cos/(w l), joint by joint, harmonics inside.'
    )
    set_point: FloatList = param(
        (), unit='rad', doc='Goal of `set_point` and `step`, one a joint.'
    )
    amplitude: FloatList = param((), unit='rad', doc='Amplitude of `harmonic`, one a joint.')
    attitude_xyzw: FloatList = param(
        (), doc='Goal q_WB of `set_point` and `step`, normalised within 1e-3; empty: as it is.'
    )
    attitude_amplitude: FloatList = param(
        (),
        unit='rad',
        doc='Rotation vector of `harmonic`, in base coordinates at the start; empty: none.',
    )
    repeat: bool = param(
        False, doc='Start the Fourier motion again when it ends, instead of holding.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The controller: law, gains, limits and time-outs."""

    law: str = param(
        'computed_torque',
        choices=(*COMPUTED_TORQUE_LAWS, *ADAPTIVE_LAWS),
        doc='Control law. computed_torque: joints of a floating base. The others control the '
        "base's attitude, too: passivity with fixed parameters; adaptive_rls by filtered least "
        'squares; adaptive_lyapunov by the gradient of the Lyapunov function; adaptive_composite '
        'by both; `_paper` as in the papers, for comparison.',
    )
    physical_consistency: str = param(
        'project',
        choices=CONSISTENCIES,
        doc='Adaptive laws: none; project: onto physical bodies in the metric of the '
        'information; natural: gradient law on the manifold of physical bodies '
        '(adaptive_lyapunov).',
    )
    bandwidth: float = param(
        1.0,
        unit='rad/s',
        above=0.0,
        maximum=100.0,
        doc='Double pole of the error dynamics.',
    )
    use_estimate: bool = param(
        True,
        doc='Use the latest valid /estimate; adaptive laws start from the first one. Otherwise '
        'the model of the robot file.',
    )
    torque_limit: FloatList = param(
        (), unit='N m', above=0.0, doc="One a joint; empty: the URDF's effort limits."
    )
    base_torque_limit: FloatList = param(
        (), unit='N m', above=0.0, doc='On the base, one an axis of base_link; empty: none.'
    )
    damping: float = param(
        1.0, unit='1/s', above=0.0, doc='Decay of the joint rates while damping to zero.'
    )
    state_timeout: float = param(
        0.1, unit='s', above=0.0, doc='Age of the joint states or gyro that ends tracking.'
    )
    attitude_timeout: float = param(
        1.0,
        unit='s',
        above=0.0,
        doc='Age of the attitude that ends tracking where the law controls it; younger ones are '
        'carried on with the gyro.',
    )
    hold_compensation: bool = param(
        True,
        doc='Computed torque: evaluate the law at the middle of the interval that holds its '
        'torque.',
    )
    save_parameters: str = param(
        '',
        doc='YAML to which ~/save_parameters and the end of the node write the robot with the '
        'parameters in force, the URDF beside it; empty: nowhere.',
    )
