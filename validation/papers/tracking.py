"""Tracking with and without knowledge of the captured wheels (Figs 4-7), in continuous time.

The law is evaluated inside every stage of the integrator, so that what is left is the law's own
error and not that of a sampled loop. Two plants: the correct one, and the paper's, whose printed
joint equations (16)-(20) lack the wheels' torque on the joints. The paper's own law (35) is
perfect on the paper's plant and fails on the correct one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from spacerobot_ros.control.computed_torque import Model, estimated_model, law_model
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import RK4, rk_step
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.types import Array

from . import paper
from .paper import Scenario, continuous_torque, scenario

PLANTS = ('correct', 'paper')
LAWS = {
    'corrected': 'computed_torque',
    'no_aam': 'computed_torque_no_aam',
    'paper': 'computed_torque_paper',
}
_END_EFFECTOR = np.array([2.0, 0.0, 0.0])  # in the last body's frame, Table I
_DURATION = 20.0
_FINE, _COARSE = 0.02, 0.05  # s; the coarse one is right to 1e-4 deg

TrackedRun = dict[str, Any]
"""A closed-loop run: `axes`, `plant`, `law` (or where its model comes from), `bandwidth` (double
pole of the error dynamics [rad/s]); largest error of any joint `max_joint_error_deg` and of the
end effector in the base frame `max_end_effector_error_m`; the `reference` of both; as `history`
time (N,) [s], joint_error (N, 3) [rad], end_effector_error (N,) [m], torque (N, 3) [N m] and
omega_WB_B (N, 3) [rad/s]."""


def track(axes: str, plant: str, law: str, bandwidth: float) -> TrackedRun:
    """Follow Table II's motion with a law that knows the robot's parameters.

    Args:
        axes: Joint axes.
        plant: One of `PLANTS`.
        law: One of `LAWS`.
        bandwidth: Double pole [rad/s].
    """
    case = scenario(axes)
    model = law_model(LAWS[law], case.robot)
    # where the law is the plant's own inverse, only truncation is left to see
    step = _FINE if law == 'corrected' or law == plant else _COARSE
    return _simulate(case, plant, law, model, bandwidth, step)


def track_identified(
    axes: str, name: str, estimate: Estimate, bandwidth: float = 1.0
) -> TrackedRun | None:
    """The corrected law with identified parameters, correct plant; None where unusable."""
    case = scenario(axes)
    model = estimated_model(case.believed, 'symmetric', estimate)
    try:
        return _simulate(case, 'correct', name, model, bandwidth, _COARSE)
    except IdentificationError:
        return None


def soft_bandwidth(axes: str, plant: str, error_deg: float) -> TrackedRun:
    """The run without the wheels' knowledge that errs by so much: how soft must the gains be?"""

    def excess(logarithm: float) -> float:
        run = track(axes, plant, 'no_aam', float(np.exp(logarithm)))
        return float(np.log(run['max_joint_error_deg'] / error_deg))

    found = brentq(excess, np.log(0.2), np.log(1.0), xtol=3e-3)
    return track(axes, plant, 'no_aam', float(np.exp(found)))


def _simulate(
    case: Scenario, plant: str, law: str, model: Model, bandwidth: float, step: float
) -> TrackedRun:
    dynamics = Dynamics(case.robot, joint_reaction=plant == 'correct')
    torque = continuous_torque(case, model, bandwidth)
    times = np.array([step * k for k in range(round(_DURATION / step) + 1)])
    x = case.initial.to_vector()
    states = [x]
    for t in times[:-1]:
        x = rk_step(lambda s, y: dynamics.rate(y, torque(s, y)), float(t), x, step, RK4)
        x[3:7] /= np.linalg.norm(x[3:7])
        states.append(x)
    wanted = np.array([case.reference.at(float(t)).q for t in times])
    error = wanted - np.array(states)[:, 7:10]
    miss = np.array([_miss(dynamics, y, q) for y, q in zip(states, wanted, strict=True)])
    largest = float(np.rad2deg(np.max(np.abs(error)))), float(np.max(miss))
    return {
        'axes': case.axes,
        'plant': plant,
        'law': law,
        'bandwidth': bandwidth,
        **dict(zip(paper.TRACKING_ERRORS, largest, strict=True)),
        'reference': paper.tracking_reference(case.axes, plant, law, bandwidth),
        'history': {
            'time': times,
            'joint_error': error,
            'end_effector_error': miss,
            'torque': [torque(float(t), y) for t, y in zip(times, states, strict=True)],
            'omega_WB_B': np.array(states)[:, 13:16],
        },
    }


def _miss(dynamics: Dynamics, x: Array, wanted: Array) -> float:
    actual = State.from_vector(x)
    places = (
        dynamics.body_position(state, len(wanted), _END_EFFECTOR)
        for state in (actual, replace(actual, q=wanted))
    )
    return float(np.linalg.norm(np.subtract(*places)))
