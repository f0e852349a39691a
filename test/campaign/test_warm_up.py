"""What the set-up compiles is what is called afterwards."""

from __future__ import annotations

from spacerobot_ros.campaign import warm_up
from spacerobot_ros.campaign.hidden.diagnosis_scenario import robot_file
from spacerobot_ros.campaign.hidden.monitor_flights import Flight, monitor_of, watch
from spacerobot_ros.diagnosis.flight.wheel_momentum import constant_pass
from spacerobot_ros.dynamics.rnea_derivatives import rnea_derivatives
from spacerobot_ros.estimation.filters.kalman import correlate, gains_of, whiten


def test_made_up_calls_of_fits_are_those_of_a_diagnosis():
    kernels, robot = (rnea_derivatives, gains_of, whiten, correlate), robot_file('servicer').robot
    warm_up.call_fits(robot)
    made_up = [set(kernel.signatures) for kernel in kernels]
    assert all(made_up)
    waited = []
    warm_up.call_rest(robot, lambda: waited.append(True))
    assert waited == [True]
    assert [set(kernel.signatures) for kernel in kernels] == made_up


def test_what_a_monitor_calls_in_flight_is_compiled_before():
    warm_up.call_fits(robot_file('servicer').robot)
    made_up = set(constant_pass.signatures)
    flight, states = Flight(seed=4), []
    states += watch(monitor_of(flight, learn=1.0), flight.samples(2.0))
    assert made_up
    assert states[-1].judged_ns is not None
    assert set(constant_pass.signatures) == made_up
