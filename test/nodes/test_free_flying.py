"""Base attitude and joints under adaptive laws, on nodes in lockstep."""

import time

import numpy as np
import pytest
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from numpy.testing import assert_allclose
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Parameters, Tracking
from std_srvs.srv import Trigger
from support.free_flying import (
    JOINTS,
    ROBOT_FILE,
    core_errors,
    errors,
    estimate_of,
    file_with,
    free_flying_parameters,
    rms_degrees,
)
from support.rig import Rig, Wall, file_parameters

from spacerobot_ros.control.adaptive.parameter_prior import load
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.recording import messages
from spacerobot_ros.ros import convert
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import LATCHED, SAMPLES, STATE

pytestmark = pytest.mark.ros


def node_parameters(law, period, **more):
    return {
        **file_parameters(ROBOT_FILE),
        **free_flying_parameters(law, period, **more),
        'simulator.lockstep': True,
        'use_sim_time': True,
    }


class Loop:
    """Simulator and controller, with the true errors at every step."""

    def __init__(self, rig, parameters, order=(0, 1)):
        self.rig, self.errors = rig, []
        ears = rig.plain()
        self.tracking = rig.listen(ears, Tracking, '/tracking', SAMPLES)
        self.in_force = rig.listen(ears, Parameters, '/controller/parameters_in_force', LATCHED)
        nodes = {}
        for index in order:
            nodes[index] = rig.add((SimulatorNode, ControllerNode)[index], parameters)
        self.sim, self.controller = nodes[0], nodes[1]
        self.period = parameters['simulator.period']
        start = self.sim.plant.state
        self.sim.observers.append(
            lambda plant: self.errors.append(errors(start, plant.state, plant.time_ns * 1e-9))
        )

    def run(self, steps):
        self.sim.stop_at = steps
        self.rig.until(lambda: len(self.tracking) > steps)
        return np.array(self.errors[:steps])


@pytest.mark.parametrize(('period', 'steps'), [(0.05, 400), (0.005, 800)], ids=['20Hz', '200Hz'])
def test_nodes_track_as_the_law_alone(rig, period, steps):
    file = file_with(free_flying_parameters('adaptive_composite', period))
    want = core_errors(file, steps)  # first: samples are sent again while the law compiles
    loop = Loop(rig, node_parameters('adaptive_composite', period))
    got = loop.run(steps)
    # in lockstep without noise nothing but rounding of stamps and attitudes differs
    assert_allclose(got, want, rtol=0, atol=1e-7)
    assert_allclose(rms_degrees(got), rms_degrees(want), rtol=1e-3)
    assert loop.sim.health.count() + loop.controller.health.count() == 0
    assert {t.state for t in loop.tracking} == {'tracking'}
    assert_allclose(
        np.linalg.norm(loop.tracking[-1].attitude_error), loop.errors[-1][0], rtol=0, atol=1e-9
    )


def test_the_order_of_the_nodes_does_not_show(rig):
    parameters = node_parameters('adaptive_rls', 0.05) | {'simulator.noise': True}
    first = Loop(rig, parameters).run(100)
    other = Rig()
    try:
        second = Loop(other, parameters, order=(1, 0)).run(100)
    finally:
        other.close()
    assert np.array_equal(first, second)


class Bench:
    """A controller alone, with a probe that plays the sensors of a robot at rest."""

    def __init__(self, rig, **more):
        self.rig, self.probe = rig, rig.plain()
        listen = rig.listen
        self.wrenches = listen(self.probe, WrenchStamped, '/base_torque', SAMPLES)
        self.commands = listen(self.probe, JointState, '/joint_commands', SAMPLES)
        self.tracking = listen(self.probe, Tracking, '/tracking', SAMPLES)
        self.in_force = listen(self.probe, Parameters, '/controller/parameters_in_force', LATCHED)
        self.imu = self.probe.create_publisher(Imu, '/imu/data', STATE)
        self.attitude = self.probe.create_publisher(QuaternionStamped, '/attitude', STATE)
        self.joints = self.probe.create_publisher(JointState, '/joint_states', STATE)
        self.estimates = self.probe.create_publisher(EstimateMessage, '/estimate', LATCHED)
        parameters = node_parameters('adaptive_rls', 0.05) | {'simulator.lockstep': False} | more
        self.node = rig.add(ControllerNode, parameters)
        self.wall = Wall()
        self.node.wall_ns = self.wall.ns

    def sample(self, ms, attitude=(0.0, 0.0, 0.0, 1.0)):
        ns = ms * 1_000_000
        self.wall.ms = ms
        self.rig.set_time(ns)
        self.imu.publish(compose.imu(ns, 'base_link', np.zeros(3), None))
        if attitude is not None:
            self.attitude.publish(compose.quaternion(ns, np.array(attitude)))
        self.rig.deliver()
        self.joints.publish(compose.joint_state(ns, list(JOINTS), np.ones(4), np.zeros(4)))
        self.rig.deliver()

    def call(self, service):
        client = self.probe.create_client(Trigger, service)
        self.rig.until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.rig.until(future.done)
        return future.result()

    def status(self, name):
        return next(s for s in self.node.health.statuses() if s.name == name)


def torque(wrench):
    t = wrench.wrench.torque
    return np.array([t.x, t.y, t.z])


def test_joint_and_base_torques_come_together_and_stop_together(rig):
    bench = Bench(rig)
    for k in range(3):
        bench.sample(50 * k)
    assert [w.header.stamp for w in bench.wrenches] == [c.header.stamp for c in bench.commands]
    assert bench.wrenches[0].header.frame_id == 'base_link'
    assert np.abs(torque(bench.wrenches[-1])).max() > 0.1  # the motion starts with a rate
    assert_allclose(bench.tracking[-1].base_torque, torque(bench.wrenches[-1]), rtol=0, atol=0)
    bench.node.trigger_deactivate()
    rig.drain()
    assert not torque(bench.wrenches[-1]).any()
    assert not np.any(bench.commands[-1].effort)


def test_a_lost_attitude_is_said_and_frees_the_base(rig):
    bench = Bench(rig, **{'controller.attitude_timeout': 0.2})
    for k in range(10):
        bench.sample(50 * k, attitude=(0.0, 0.0, 0.0, 1.0) if k < 3 else None)
    assert [t.state for t in bench.tracking] == ['tracking'] * 7 + ['damping'] * 3
    assert not torque(bench.wrenches[-1]).any()
    assert bench.status('inputs').message == 'attitude is stale'
    assert 'no torque on the base: attitude is stale' in bench.status('control').message


@pytest.mark.parametrize(
    ('attitude', 'reason'),
    [
        ((0.0, 0.0, 0.0, 1.1), 'quaternion has norm #, not #'),
        ((np.nan, 0.0, 0.0, 1.0), 'quaternion is not finite'),
    ],
)
def test_bad_attitudes_are_counted(rig, attitude, reason):
    bench = Bench(rig)
    bench.sample(0)
    bench.sample(50, attitude)
    assert bench.node.health.rejected['/attitude', reason] == 1
    assert bench.tracking[-1].state == 'tracking'  # carried on with the gyro
    assert np.isfinite(torque(bench.wrenches[-1])).all()


def test_saturation_is_said_and_pauses_the_adaptation(rig):
    bench = Bench(rig, **{'controller.base_torque_limit': [1e-3] * 3})
    for k in range(4):
        bench.sample(50 * k)
    assert bench.tracking[-1].base_saturated
    assert np.abs(torque(bench.wrenches[-1])).max() == 1e-3
    assert 'torque at its limit' in bench.status('control').message
    assert bench.status('adaptation').message == 'not adapting: a torque limit was reached'


def test_parameters_are_published_saved_and_loaded(rig, tmp_path):
    path = tmp_path / 'adapted.yaml'
    bench = Bench(rig, **{'controller.save_parameters': str(path)})
    for k in range(45):
        bench.sample(50 * k)
    assert [messages.stamp_ns(m.header.stamp) for m in bench.in_force] == [0, 10**9, 2 * 10**9]
    last = bench.in_force[-1]
    size = len(last.values)
    assert len(last.names) == len(last.units) == size
    covariance = np.reshape(last.covariance, (size, size))
    assert np.linalg.eigvalsh(covariance)[0] > -1e-9 * np.linalg.norm(covariance)
    assert last.law == 'adaptive_rls'
    assert last.physical
    assert not last.from_estimate
    answer = bench.call('/controller/save_parameters')
    assert answer.success
    assert str(path) in answer.message
    values = bench.node.loop.adaptive.parameters.values
    loaded = load_robot_file(path)
    # text of the URDF keeps all digits; inertias move from link origin to centre of mass and back
    assert_allclose(loaded.robot.inertial_parameters.ravel(), values, rtol=1e-9, atol=1e-9)
    assert loaded.settings.controller.law == 'adaptive_rls'
    again = rig.add(ControllerNode, file_parameters(path))
    assert_allclose(again.loop.adaptive.parameters.values, values, rtol=1e-9, atol=1e-9)


def test_saving_needs_a_path(rig):
    answer = Bench(rig).call('/controller/save_parameters')
    assert not answer.success
    assert answer.message.startswith('controller.save_parameters: is empty')


def test_parameters_are_saved_at_the_end(rig, tmp_path):
    path = tmp_path / 'end.yaml'
    bench = Bench(rig, **{'controller.save_parameters': str(path)})
    bench.sample(0)
    rig.executor.remove_node(bench.node)
    rig.nodes.remove(bench.node)
    bench.node.destroy_node()
    assert load_robot_file(path).robot.n_joints == 4


def test_an_estimate_starts_the_adaptation_and_an_indefinite_one_does_not(rig, tmp_path):
    saved = tmp_path / 'learned.json'
    bench = Bench(rig, **{'controller.save_file': str(saved)})
    bench.sample(0)
    good = convert.estimate_message(
        estimate_of(file_with(free_flying_parameters('adaptive_rls', 0.05))), 0
    )
    size = len(good.parameters)
    bad = np.reshape(good.covariance, (size, size)).copy()
    bad[0, 1] = bad[1, 0] = 2.0 * np.sqrt(bad[0, 0] * bad[1, 1])
    kept, good.covariance = good.covariance, bad.ravel().tolist()
    bench.estimates.publish(good)
    rig.deliver()
    assert bench.node.health.rejected['/estimate', 'estimate: the covariance is indefinite'] == 1
    good.covariance = kept
    bench.estimates.publish(good)
    rig.deliver()
    bench.sample(50)
    assert bench.tracking[-1].uses_estimate
    assert 'started from an estimate' in bench.status('estimate').message
    assert bench.call('/controller/save').success
    law, robot = bench.node.loop.adaptive, bench.node.loop.robot
    kept = load(saved, robot, time.time_ns())
    assert_allclose(kept.mean, law.learned.mean, rtol=1e-12, atol=0)
    assert bench.status('adaptation').values['excitation'] == law.health.excitation


@pytest.mark.parametrize(
    ('change', 'match'),
    [
        ({'adaptive.kappa': 60.0}, r'^adaptive\.kappa: \(kappa \+ Lambda\) x period = 3\.05'),
        ({'robot.base': 'fixed'}, r'^robot\.base'),
        ({'controller.law': 'adaptive'}, r"controller\.law: 'adaptive' is not one of"),
        ({'controller.physical_consistency': 'maybe'}, r'physical_consistency'),
    ],
)
def test_what_can_not_work_is_refused_at_the_start(rig, change, match):
    with pytest.raises(ConfigurationError, match=match) as caught:
        Bench(rig, **change)
    assert '\n' not in str(caught.value)


def test_what_was_learned_survives_the_node(rig, tmp_path):
    file = {'controller.save_file': str(tmp_path / 'learned.json')}
    parameters = node_parameters('adaptive_rls', 0.05) | file
    before = Loop(rig, parameters)
    start = before.controller.loop.adaptive.parameters.values
    before.run(200)
    other = Rig()
    try:
        after = Loop(other, parameters)
        kept = after.controller.loop.adaptive.parameters.values
        learned = before.controller.loop.adaptive.parameters.values
        # saved in the last second, in which hardly anything was learned
        assert np.linalg.norm(kept - learned) < 0.05 * np.linalg.norm(learned - start)
        estimate = estimate_of(file_with(free_flying_parameters('adaptive_rls', 0.05)))
        after.controller.loop.set_estimate(estimate)  # it is older than what was adapted
        assert np.array_equal(after.controller.loop.adaptive.parameters.values, kept)
        # taken over smoothly: the transient is that of the motion's start alone
        assert after.run(40).max() < 0.8 * np.array(before.errors)[:40].max()
    finally:
        other.close()
