"""All nodes in one process: figures, speed of light aside, and the same trace every time."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Vector3Stamped
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Tracking
from support.bench import Bench
from support.rig import Rig

from spacerobot_ros.control.joint_reference import build_reference
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.recording import messages
from spacerobot_ros.ros.qos import LATCHED, SAMPLES
from spacerobot_ros.simulation.closed_loop import ClosedLoop

pytestmark = pytest.mark.ros

NO_AAM = {'controller.law': 'computed_torque_no_aam'}
# The motion of the robot file in 8 s instead of 20, at 50 Hz: still all is excited after 5.5 s.
QUICK = {
    'reference.duration': 8.0,
    'simulator.period': 0.02,
    'simulator.joint_rate': 50.0,
    'simulator.imu_rate': 50.0,
}
STEPS = 400


@pytest.fixture(scope='module')
def quick(servicer):
    return {**servicer, **QUICK}


@pytest.fixture(scope='module')
def finished(quick, tmp_path_factory):
    """Return what a run gave, and the file that its identifier left."""
    file = tmp_path_factory.mktemp('run') / 'known.json'
    return run(quick, STEPS, **{'identifier.save_file': str(file)}), file


def stamp_of(message):
    return messages.stamp_ns(message.header.stamp)


def run(parameters, steps, order=(0, 1, 2), **more):
    """Run the loop for some steps; return trace hash, largest true error [deg], estimates."""
    rig = Rig()
    try:
        ears = rig.plain()
        tracking = rig.listen(ears, Tracking, '/tracking', SAMPLES)
        estimates = rig.listen(ears, EstimateMessage, '/estimate', LATCHED)
        nodes = [SimulatorNode, IdentifierNode, ControllerNode]
        made = {}
        for index in order:
            made[index] = rig.add(nodes[index], {**parameters, **more})
        sim = made[0]
        digest, joints = hashlib.sha256(), {}

        def observe(plant):
            x = plant.state
            digest.update(x.to_vector().tobytes() + plant.effort.tobytes())
            joints[plant.time_ns] = x.q

        sim.observers.append(observe)
        sim.stop_at = steps
        end = steps * sim.plant.period_ns
        rig.until(lambda: tracking and stamp_of(tracking[-1]) >= end)
        for message in estimates:
            digest.update(np.array(message.covariance).tobytes() + np.array(message.aam).tobytes())
        references = {stamp_of(t): t.reference_position for t in tracking}
        assert list(references) == list(joints)
        error = np.array([references[ns] - q for ns, q in joints.items()])
        rejected = [node.health.count() for node in made.values()]
        return digest.hexdigest(), np.degrees(np.abs(error).max()), estimates, rejected
    finally:
        rig.close()


def test_same_seed_same_trace_whatever_the_order_of_the_nodes(quick, finished):
    # with estimates coming in and used while it runs
    first, second = finished[0], run(quick, STEPS, (2, 1, 0))
    assert first[0] == second[0]
    assert any(e.valid for e in first[2][:-1])
    assert run(quick, 20, **{'simulator.seed': 2})[0] != run(quick, 20)[0]


def test_the_nodes_track_as_the_law_alone_far_better_where_the_wheels_are_known(quick):
    known = {'robot.target_wheels.momentum': [42.0, 49.0, 41.0]}
    _, blind, _, rejected = run(quick, STEPS, (0, 2), **NO_AAM)
    file = load_robot_file('config/servicer.yaml')
    settings = file.settings.changed({**QUICK, **NO_AAM})
    reference = build_reference(settings.reference, np.zeros(3))
    steps = ClosedLoop(file.robot, settings).run(STEPS)
    alone = max(np.abs(reference.at(s.stamp_ns * 1e-9).q - s.state.q).max() for s in steps)
    assert blind == pytest.approx(np.degrees(alone), rel=1e-3)
    assert blind > 1.0
    _, seeing, _, _ = run(quick, STEPS, (0, 2), **known)
    assert seeing < blind / 50
    assert rejected == [0, 0]


def test_estimates_become_valid_and_the_controller_uses_them(finished):
    _, _, estimates, rejected = finished[0]
    assert estimates[-1].valid
    np.testing.assert_allclose(estimates[-1].aam, [42.0, 49.0, 41.0], rtol=0.01)
    assert rejected == [0, 0, 0]


def test_momentum_reads_well_and_survives_a_jump_of_the_clock(quick):
    rig = Rig()
    try:
        ears = rig.plain()
        momenta = rig.listen(ears, Vector3Stamped, '/momentum', LATCHED)
        sim = rig.add(SimulatorNode, quick)
        rig.add(ControllerNode, quick)
        identifier = rig.add(IdentifierNode, quick)
        rig.until(lambda: sim.step_index >= STEPS and momenta)
        sim.reset()
        rig.until(lambda: 150 <= sim.step_index < STEPS)
        h = momenta[-1].vector
        assert momenta[-1].header.frame_id == 'link_3'
        np.testing.assert_allclose([h.x, h.y, h.z], [42.0, 49.0, 41.0], rtol=0.01)
        assert identifier.estimate.valid
        assert identifier.estimate.aam.tolist() == [h.x, h.y, h.z]
    finally:
        rig.close()


def test_an_identifier_started_again_goes_on_from_its_file(quick, finished, tmp_path):
    path = shutil.copy(finished[1], tmp_path)
    rig = Rig()
    try:
        bench = Bench(rig, quick, **{'identifier.save_file': path})
        estimates = bench.estimates
        rig.until(lambda: estimates)  # without a sample
        assert estimates[-1].valid
        np.testing.assert_allclose(estimates[-1].aam, [42.0, 49.0, 41.0], rtol=0.05)
        response = bench.call('/identifier/save')
        assert not response.success
        assert response.message == 'nothing new is known that is valid'
        Path(path).write_text('{}', encoding='utf-8')
        response = bench.call('/identifier/load')
        assert not response.success
        assert 'known.json: is damaged' in response.message
        assert bench.node.estimate.valid
    finally:
        rig.close()


def test_reset_of_the_simulator_restarts_all(servicer):
    rig = Rig()
    try:
        sim = rig.add(SimulatorNode, servicer)
        controller = rig.add(ControllerNode, servicer)
        identifier = rig.add(IdentifierNode, servicer)
        rig.until(lambda: sim.step_index >= 250)
        sim.reset()
        rig.until(lambda: 50 <= sim.step_index < 250)
        assert controller.last_command.stamp_ns < 10**9
        assert max(sample[0] for sample in identifier.latest.values()) < 10**9
        assert controller.health.rejected + identifier.health.rejected == {}
    finally:
        rig.close()


def test_a_simulator_that_is_reset_at_its_start_goes_on(servicer):
    """Time goes back by less than stamps may be out of order."""
    rig = Rig()
    try:
        sim = rig.add(SimulatorNode, servicer)
        controller = rig.add(ControllerNode, servicer)
        rig.until(lambda: sim.step_index >= 5)
        sim.reset()
        rig.until(lambda: sim.step_index >= 10)
        assert not controller.health.rejected
    finally:
        rig.close()


def test_slow_and_uneven_sensors_still_close_the_loop(servicer):
    rates = {
        'simulator.joint_rate': 50.0,
        'simulator.imu_rate': 20.0,
        'simulator.attitude_rate': 2.0,
        'robot.target_wheels.momentum': [42.0, 49.0, 41.0],
    }
    rig = Rig()
    try:
        sim = rig.add(SimulatorNode, servicer, **rates)
        controller = rig.add(ControllerNode, servicer, **rates)
        rig.add(IdentifierNode, servicer, **rates)
        worst = []
        sim.observers.append(
            lambda plant: (
                worst.append(np.abs(controller.last_command.error).max())
                if controller.last_command
                else None
            )
        )
        rig.until(lambda: sim.step_index >= 500)
        assert controller.last_command.mode == 'tracking'
        assert np.degrees(max(worst)) < 0.2  # the gyro is up to 50 ms old
    finally:
        rig.close()
