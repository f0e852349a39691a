"""What a diagnosis says; reports, JSON and messages are made from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ...effects.effect import Effect
from ...json_values import json_as, json_fields
from ...types import Array
from ..events.event import Events
from .cause import Cause, Estimated

VERDICTS = ('consistent', 'explained', 'partly_explained', 'unexplained')
Method = Literal['prediction', 'balance', 'pose', 'spin']
"""How data were held against the model: every sensor predicted sample by sample, torques balanced
along the motion, or a lone body's windows of pose or of spin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Residual:
    """One channel before and after.

    Args:
        channel: Such as `joint_torque/joint_2` or `gyro/x`.
        unit: SI.
        rms_before: Of the one-step prediction error of the model as it stands.
        rms_after: Of the extended model's.
        noise_floor: What a right model has, from the sensors' noise.
        whiteness_p: Probability that the extended model's errors are white; nan: not tested.
        whiteness_p_before: The same for the model as it stands.
    """

    channel: str
    unit: str
    rms_before: float
    rms_after: float
    noise_floor: float = math.nan
    whiteness_p: float = math.nan
    whiteness_p_before: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One channel along the record, for plots.

    Args:
        channel: As in `Residual`. unit: SI.
        time: (M,) [s].
        measured: (M,) measured value; empty where the channel is no sensor's.
        before: (M,) prediction error of the model as it stands.
        after: (M,) prediction error of the extended model.
        noise_floor: Standard deviation that a right model has.
    """

    channel: str
    unit: str
    time: Array
    measured: Array
    before: Array
    after: Array
    noise_floor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionLaw:
    """Friction closest to all named frictions of a joint.

    Args:
        joint: Its name.
        unit: Of torques; of forces where it slides. viscous_unit: Of `viscous`.
        coulomb: Torque of constant size, the mean of both directions.
        viscous: By the rate.
        coulomb_forward: Of positive rates: an offset of the torque is a friction of two
            sizes where the joint moves; only dwells tell them apart.
        coulomb_backward: Of negative rates.
    """

    joint: str
    unit: str
    viscous_unit: str
    coulomb: float
    viscous: float
    coulomb_forward: float
    coulomb_backward: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """What holds of a joint for any scale of all torques, masses and inertias.

    Args:
        joint: Its name. ratio: Such as `weight_by_inertia` (docs/diagnosis.md).
        of: The other joint, of `inertia_by_inertia`: of its inertia coupling with the joint.
        value: In `unit`. std: Standard deviation; nan where nothing that was found changes it, and
            it is the file's.
    """

    joint: str
    ratio: str
    of: str | None
    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeMotion:
    """How far predictions of a joint without a motor are from what it did.

    Args:
        joint: Its name. unit: rad or m.
        horizon: Time that is predicted at once, from the best start [s].
        windows: Number of such times.
        rms_before: Over all of them, of the model as it stands. rms_after: Of the extended one.
        median_before: Median of the windows' own. median_after: The same of the extended one.
    """

    joint: str
    unit: str
    horizon: float
    windows: int
    rms_before: float
    rms_after: float
    median_before: float
    median_after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingMisfit:
    """Rms of the torques that models miss of one recording, over all joints where they move.

    Args:
        source: Where it came from.
        rms_before: Of the model as it stands [N m]. rms_after: Of the extended one [N m].
        worse: By joint, the ratio of both where the extended model leaves over 2 % more.
    """

    source: str
    rms_before: float
    rms_after: float
    worse: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Held-out prediction error, in standard deviations of the noise: 1 is perfect.

    Where nobody knows the noise (methods `balance` and `pose`), in those of what is left.

    Args:
        before: Of the model as it stands. after: Of the extended model, fitted to the rest.
        placebo: Of the best placebo extension of the same size.
    """

    json_too = ('ratio',)
    before: float = json_as('held_out_rmse_before', default=math.nan)
    after: float = json_as('held_out_rmse_after', default=math.nan)
    placebo: float = json_as('held_out_rmse_placebo', default=math.nan)

    @property
    def ratio(self) -> float:
        """After by before; nan where nothing was left before."""
        return self.after / self.before if self.before else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Leftover:
    """What one channel's leftover depends on.

    Args:
        channel: As in `Residual`.
        depends_on: Variables, such as `rate/joint_2`; `time`, or `nothing measured`.
        form: Of the law; None where there is none.
        coefficients: Of its columns.
        resembles: Class of laws, or in words what it is.
        kind: What it does with energy; empty without a law.
        p_value: Of such a law by chance.
        share: Of the whitened leftover that it explains.
        held_out_gain: The same of parts that it was not fitted to.
        placebo_gain: No longer computed.
        other_recording: The same of recordings that it was not fitted to.
        rivals: Laws that this motion can not tell from it.
        applied: The law as it is simulated; None where it is not worth it.
        one_speed: Whether the joint moves at one speed, so that forms can not be told apart.
    """

    channel: str
    depends_on: tuple[str, ...]
    form: str | None = None
    coefficients: tuple[Estimated, ...] = ()
    resembles: str = ''
    kind: str = ''
    p_value: float | None = None
    share: float | None = None
    held_out_gain: float | None = None
    placebo_gain: float | None = None
    other_recording: float | None = None
    rivals: tuple[LawRival, ...] = json_as('indistinguishable_from', default=())
    applied: Effect | None = json_as('learned', default=None)
    one_speed: bool = False

    def to_json(self) -> dict[str, Any]:
        """As in diagnosis.json."""
        learned = None if self.applied is None else self.applied.name
        return json_fields(self) | {'kind': self.kind or None, 'learned': learned}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Covariance:
    """Of the values of named causes.

    Args:
        names: (k,) effect/place/parameter: 'joint_viscous_friction/joint_2/coefficient'.
        matrix: (k, k); NaN between values of causes that were put together afterwards.
    """

    names: tuple[str, ...]
    matrix: Array


@dataclass(frozen=True, slots=True)
class Order:
    """A line of a raw signal against an angle: of a joint's effort against its own, or a wheel's.

    Args:
        joint: Name of the joint, a candidate of `joint_torque_ripple`, or of the wheel.
        unit: Of the amplitude: N m, N where a joint slides, rad/s of a gyro.
        order: Periods a turn; 2 pi times those a metre where it slides.
        amplitude: Of the line.
        phase: At position zero, of a wheel at the first sample of its rate [rad].
        p_value: Of such a line by chance.
        channel: Where a wheel shows, as in `Residual`; empty of a joint's own effort.
    """

    joint: str
    unit: str
    order: float
    amplitude: float
    phase: float
    p_value: float
    channel: str = json_as(default='')


@dataclass(frozen=True, slots=True, kw_only=True)
class LawRival:
    """A law that could stand in another's place: its form, variables, and gap in log evidence."""

    form: str
    depends_on: tuple[str, ...]
    gap: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnosis:
    """The whole answer.

    Args:
        verdict: One of `VERDICTS`.
        sentence: The verdict in words.
        causes: Named causes by evidence.
        minor: Causes too small to matter: fitted, not named.
        residuals: Channel by channel.
        series: The same along the record.
        gain: On the held-out part.
        ranking: Empty: candidates are judged beside each other.
        fit_p: Probability that a right model fits as badly as the extended one; None: not tested.
        null_p: The same for the model as it stands.
        next_motion: What to fly to know more.
        notes: What else a user should know.
        calibration: Corrections of the file within the tolerance that any file has, fitted beside
            the causes: they stand in the extended model and are not named.
        recordings: Every recording, where torques were balanced.
        friction: There, the friction of each joint as one law.
        leftover: What it depends on, channel by channel; None where that was not asked.
        orders: Lines above the band of a balance, by joint and wheel; None where not asked.
        ratios: There, what holds for any scale of the torques, where none is measured.
        free_motion: There, how far joints without a motor are predicted (before, after).
        events: What came from outside once; None where that was not looked for.
        covariance: Of the named values; None where it was not computed.
        method: How it was judged.
    """

    verdict: str
    sentence: str
    causes: tuple[Cause, ...] = ()
    minor: tuple[Cause, ...] = ()
    residuals: tuple[Residual, ...] = ()
    series: tuple[Series, ...] = json_as(default=())
    gain: Gain = Gain()
    ranking: tuple[()] = ()
    fit_p: float | None = None
    null_p: float | None = None
    next_motion: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    calibration: tuple[Effect, ...] = ()
    recordings: tuple[RecordingMisfit, ...] = ()
    friction: tuple[FrictionLaw, ...] = ()
    leftover: tuple[Leftover, ...] | None = None
    orders: tuple[Order, ...] | None = None
    ratios: tuple[Ratio, ...] = ()
    free_motion: tuple[FreeMotion, ...] = ()
    events: Events | None = None
    covariance: Covariance | None = None
    method: Method = json_as(default='prediction')
