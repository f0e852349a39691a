"""A diagnosis made by hand, for tests of what is said about one."""

from __future__ import annotations

import math

import numpy as np

from spacerobot_ros.diagnosis.answer.cause import Cause, Estimated, Evidence, Rival
from spacerobot_ros.diagnosis.answer.result import Diagnosis, Gain, Residual, Series
from spacerobot_ros.effects.catalogue import CATALOGUE


def cause_within_a_tenth(kind: str, where: str, **values: float) -> Cause:
    """A cause whose values are known within a tenth."""
    applied = CATALOGUE[kind](name=kind, where=where, values=values)
    return Cause(
        applied=applied,
        parameters={
            p.name: Estimated(value=values[p.name], std=0.1 * abs(values[p.name]), unit=p.unit)
            for p in applied.parameters
        },
        evidence=Evidence(),
        thresholds={p.name: p for p in applied.parameters},
        relevant=True,
    )


def friction_cause(rivals: tuple[Rival, ...] = ()) -> Cause:
    """Viscous friction of 3 N m s/rad at joint_2."""
    applied = CATALOGUE['joint_viscous_friction'](
        name='joint_viscous_friction_joint_2',
        where='joint_2',
        values={'coefficient': 3.0},
    )
    return Cause(
        applied=applied,
        parameters={'coefficient': Estimated(value=3.0, std=0.05, unit='N m s/rad')},
        evidence=Evidence(
            log_likelihood_gain=812.0,
            bic_gain=1610.0,
            p_value=0.0,
            held_out_gain=0.97,
            placebo_gain=0.02,
        ),
        rivals=rivals,
        thresholds={p.name: p for p in applied.parameters},
        relevant=True,
        constant_p=0.5,
    )


def hand_made(verdict: str = 'explained', rivals: tuple[Rival, ...] = ()) -> Diagnosis:
    """One cause, one minor one whose value is infinite, two channels, one without a test."""
    drag = CATALOGUE['target_wheel_drag']
    values = {'time_constant': math.inf}
    endless = drag(name='drag', where='link_3', values=values)
    cause = friction_cause(rivals)
    minor = Cause(
        applied=endless,
        parameters={'time_constant': Estimated(value=math.inf, std=math.nan, unit='s')},
        evidence=cause.evidence,
        rivals=(),
        thresholds={p.name: p for p in drag.parameters},
        relevant=False,
        constant_p=0.5,
    )
    time = np.arange(0.0, 10.0, 0.01)
    wave = np.sin(time)
    rate = Series('joint_rate/joint_2', 'rad/s', time, wave, 0.1 * wave, 0.01 * wave, 0.01)
    torque = Series(
        'joint_torque/joint_2', 'N m', time[::50], np.zeros(0), wave[::50], 0.1 * wave[::50], 0.1
    )
    return Diagnosis(
        verdict=verdict,
        sentence='The data differ from the model by friction; nothing else is left.',
        causes=(cause,),
        minor=(minor,),
        residuals=(_residual(torque, math.nan), _residual(rate, 0.4)),
        series=(torque, rate),
        gain=Gain(before=7.0, after=1.01, placebo=6.8),
        fit_p=0.3 if verdict in ('consistent', 'explained') else 1e-9,
        null_p=0.0,
        next_motion=(),
        notes=('joints: 1 gap',),
    )


def _residual(series: Series, p: float) -> Residual:
    return Residual(
        channel=series.channel,
        unit=series.unit,
        rms_before=float(np.sqrt(np.mean(series.before**2))),
        rms_after=float(np.sqrt(np.mean(series.after**2))),
        noise_floor=series.noise_floor,
        whiteness_p=p,
        whiteness_p_before=p,
    )
