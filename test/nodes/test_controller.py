"""Controller node: answers, life cycle, references, estimates, stale and bad input."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from numpy.testing import assert_allclose
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Tracking
from support.rig import Wall
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.recording import messages
from spacerobot_ros.ros import convert
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import LATCHED, SAMPLES, STATE

pytestmark = pytest.mark.ros

NAMES = ['joint_1', 'joint_2', 'joint_3']
MS = 1_000_000

LOCKSTEP = {'simulator.lockstep': True, 'simulator.lockstep_timeout': 0.1}


class Bench:
    """A controller with a probe that plays the sensors; the rig moves the clock."""

    def __init__(self, rig, parameters, **more):
        self.rig, self.probe = rig, rig.plain()
        self.commands = rig.listen(self.probe, JointState, '/joint_commands', SAMPLES)
        self.tracking = rig.listen(self.probe, Tracking, '/tracking', SAMPLES)
        self.imu = self.probe.create_publisher(Imu, '/imu/data', STATE)
        self.joints = self.probe.create_publisher(JointState, '/joint_states', STATE)
        self.estimates = self.probe.create_publisher(EstimateMessage, '/estimate', LATCHED)
        self.references = self.probe.create_publisher(JointTrajectory, '/reference', STATE)
        overrides = {'simulator.lockstep': False, 'reference.kind': 'hold', **more}
        self.node = rig.add(ControllerNode, {**parameters, **overrides})
        self.wall = Wall()
        self.node.wall_ns = self.wall.ns

    def gyro(self, ms, omega=(0.1, 0.12, 0.08), frame='base_link'):
        self.imu.publish(compose.imu(ms * MS, frame, np.array(omega), None))
        self.rig.deliver()

    def joint(self, ms, q=(0.0, 0.0, 0.0), qd=(0.0, 0.0, 0.0), names=NAMES):
        message = compose.joint_state(ms * MS, list(names), np.array(q), np.array(qd))
        self.joints.publish(message)
        self.rig.deliver()

    def sample(self, ms, **joint):
        self.rig.set_time(ms * MS)
        self.wall.ms = ms
        self.gyro(ms)
        self.joint(ms, **joint)

    def later(self):
        self.wall.ms += 25
        return True

    def answered(self):
        return [messages.stamp_ns(c.header.stamp) // MS for c in self.commands]

    def status(self, name):
        return next(s for s in self.node.health.statuses() if s.name == name)


@pytest.fixture
def bench(rig, servicer):
    return Bench(rig, servicer)


def test_answers_every_joint_sample_with_its_stamp(bench):
    for k in range(5):
        bench.sample(10 * k)
    assert bench.answered() == [0, 10, 20, 30, 40]
    assert list(bench.commands[0].name) == NAMES
    assert np.isfinite(bench.commands[-1].effort).all()
    message = bench.tracking[-1]
    assert (message.law, message.state) == ('computed_torque', 'hold')
    assert not message.uses_estimate


def test_joints_in_another_order_and_among_others(bench):
    bench.sample(0, q=(9.0, 3.0, 1.0, 2.0), qd=(0.0,) * 4, names=['x', *NAMES[2:], *NAMES[:2]])
    assert_allclose(bench.tracking[0].reference_position, [1.0, 2.0, 3.0], rtol=0, atol=0)


def test_life_cycle_gates_the_torque(rig, servicer):
    bench = Bench(rig, servicer, autostart=False)
    bench.sample(0)
    assert bench.commands == []
    bench.node.trigger_configure()
    bench.sample(10)
    assert bench.commands == []
    bench.node.trigger_activate()
    rig.drain()
    assert bench.answered() == [10]  # the sample that was waiting
    bench.sample(20)
    bench.node.trigger_deactivate()
    bench.sample(30)
    assert bench.answered() == [10, 20, 20]
    assert list(bench.commands[-1].effort) == [0.0, 0.0, 0.0]
    assert bench.status('control').message == 'inactive: no torque is commanded'


def test_gyro_that_stops_ends_tracking_and_is_named(bench):
    bench.sample(0)
    for ms in range(10, 150, 10):
        bench.rig.set_time(ms * MS)
        bench.joint(ms)
    states = [t.state for t in bench.tracking]
    assert states[:11] == ['hold'] * 11
    assert states[11:] == ['damping'] * 4
    assert bench.status('inputs').message == 'gyro is stale'
    assert 'damping to zero' in bench.status('control').message
    bench.sample(150)
    assert bench.tracking[-1].state in ('hold', 'tracking')


def event(ms, level, words):
    """A message on /events."""
    message = DiagnosticArray(status=[DiagnosticStatus(level=level, message=words)])
    message.header.stamp = compose.time(ms * MS)
    return message


@pytest.mark.parametrize(
    ('answer', 'state', 'reason'),
    [('report', 'hold', ''), ('damp', 'damping', 'a push'), ('hold', 'tracking', 'a push')],
)
def test_an_event_is_answered_as_the_robot_file_says(rig, servicer, answer, state, reason):
    bench = Bench(rig, servicer, **{'monitor.on_event': answer})
    events = bench.probe.create_publisher(DiagnosticArray, '/events', LATCHED)
    bench.sample(0)
    events.publish(event(0, DiagnosticStatus.WARN, 'a push'))
    rig.deliver()
    bench.sample(10)
    assert bench.tracking[-1].state == state
    assert bench.node.last_command.reason == reason
    assert bench.status('inputs').message == 'fresh'
    events.publish(event(10, DiagnosticStatus.OK, 'over'))
    rig.deliver()
    bench.sample(20)
    assert bench.tracking[-1].state in ('hold', 'tracking')
    assert bench.node.last_command.reason == ''


def test_a_monitor_that_knows_nothing_yet_says_of_no_event(rig, servicer):
    bench = Bench(rig, servicer, **{'monitor.on_event': 'damp'})
    events = bench.probe.create_publisher(DiagnosticArray, '/events', LATCHED)
    bench.sample(0)
    events.publish(event(0, DiagnosticStatus.STALE, 'nothing acts from outside'))
    rig.deliver()
    bench.sample(10)
    assert bench.tracking[-1].state == 'hold'


@pytest.mark.parametrize('is_latched', [False, True], ids=['now', 'before the first sample'])
def test_an_event_of_which_nothing_more_is_said_is_forgotten(rig, servicer, is_latched):
    bench = Bench(rig, servicer, **{'monitor.on_event': 'damp'})
    events = bench.probe.create_publisher(DiagnosticArray, '/events', LATCHED)
    if not is_latched:
        bench.sample(0)
    events.publish(event(0, DiagnosticStatus.WARN, 'a push'))
    rig.deliver()
    if is_latched:
        bench.sample(0)
    for ms in range(10, 2100, 50):
        bench.sample(ms)
    states = [t.state for t in bench.tracking]
    assert states[1:40] == ['damping'] * 39
    assert states[-1] in ('hold', 'tracking')


def test_joint_states_that_stop_are_noticed_on_the_wall(bench):
    # the simulator is gone, and time with it
    bench.sample(0, qd=(0.1, 0.0, 0.0))
    for ms in (90, 120, 500, 1000):
        bench.wall.ms = ms
        count = len(bench.commands)
        if ms > 100:
            bench.rig.until(lambda count=count: len(bench.commands) > count)
    assert bench.answered()[0] == 0
    assert set(bench.answered()[1:]) == {120, 500, 1000}
    assert bench.tracking[-1].state == 'damping'
    assert bench.status('inputs').message == 'joint states are stale'
    assert np.isfinite([c.effort for c in bench.commands]).all()


def test_torques_end_where_nothing_is_known_any_more(bench):
    bench.sample(0, qd=(0.1, 0.0, 0.0))
    sizes = []
    for ms in (120, 480, 1080, 1120, 60_000):
        bench.wall.ms, count = ms, len(bench.commands)
        bench.rig.until(lambda count=count: len(bench.commands) > count + 1)
        sizes.append(float(np.abs(bench.commands[-1].effort).max()))
    assert sizes[0] > sizes[1] > sizes[2] > 0.0
    assert sizes[3:] == [0.0, 0.0]  # five time constants of 0.2 s, 0.1 s after the last sample


def test_lockstep_waits_for_a_simulator_that_takes_its_time(rig, servicer):
    bench = Bench(rig, servicer, **LOCKSTEP)
    bench.sample(0, qd=(0.1, 0.0, 0.0))
    bench.wall.ms = 60_000  # in which this process stood still, too
    for _ in range(20):
        rig.drain()
    assert bench.answered() == [0]
    rig.until(lambda: bench.later() and bench.tracking[-1].state == 'damping')


@pytest.mark.parametrize(
    ('send', 'topic', 'reason'),
    [
        (lambda b: b.gyro(10, (np.nan, 0, 0)), '/imu/data', 'angular_velocity is not finite'),
        (lambda b: b.gyro(10, frame='x'), '/imu/data', "frame_id is 'x', expected 'base_link'"),
        (lambda b: b.gyro(0), '/imu/data', 'duplicate stamp'),
        (lambda b: b.gyro(-5), '/imu/data', 'stamp goes backwards by # s'),
        (lambda b: b.joint(10, q=(np.nan, 0, 0)), '/joint_states', 'position is not finite'),
        (lambda b: b.joint(10, qd=(0, np.inf, 0)), '/joint_states', 'velocity is not finite'),
        (lambda b: b.joint(10, names=list('abc')), '/joint_states',
         'joint names: lacks joint_1, joint_2, joint_3'),
        (lambda b: b.joint(10, names=NAMES[:2]), '/joint_states',
         'joint names: lacks joint_3'),
        (lambda b: b.joint(10, qd=(0.0,)), '/joint_states', 'velocity has # entries for # joints'),
        (lambda b: b.joint(100), '/joint_states', 'duplicate stamp'),
        (lambda b: b.joint(95), '/joint_states', 'stamp goes backwards by # s'),
    ],
)  # fmt: skip
def test_bad_samples_are_counted_and_the_loop_goes_on(bench, send, topic, reason):
    bench.sample(100)
    if topic == '/imu/data' and 'stamp' in reason:  # relative to the 100 ms of the first sample
        bench.gyro(100 if 'duplicate' in reason else 95)
    else:
        send(bench)
    assert bench.node.health.rejected[topic, reason] == 1
    assert bench.status('rejected').values[f'{topic}: {reason} [messages]'] == 1
    bench.sample(110)
    assert bench.answered()[-1] == 110
    assert np.isfinite([c.effort for c in bench.commands]).all()


@pytest.mark.parametrize('jump', [-5000, 10**6])
def test_stamps_that_jump_leave_the_motion_where_it_is(rig, servicer, jump):
    bench = Bench(rig, servicer, **{'reference.kind': 'fourier'})
    for ms in range(6000, 8000, 50):
        bench.sample(ms)
    before = bench.tracking[-1]
    for ms in range(8000, 8100, 10):
        bench.gyro(ms + jump)  # the clock does not move
        bench.joint(ms + jump)
    assert bench.answered()[-1] == 8090 + jump
    assert bench.node.health.count() == 0
    times = [messages.stamp_ns(t.header.stamp) // MS for t in bench.tracking]
    after = bench.tracking[times.index(8000 + jump)]
    assert after.state == 'tracking'
    # ahead of time the joints have moved unseen: the motion is joined from where they are
    where = before.reference_position if jump < 0 else [0.0] * 3
    assert_allclose(after.reference_position, where, atol=1e-3)


@pytest.mark.parametrize('ms', [0, 5300, 7000, (2**31 - 1) * 1000])
def test_one_wrong_stamp_changes_nothing(rig, servicer, ms):
    bench = Bench(rig, servicer, **{'reference.kind': 'fourier'})
    for at in range(5000, 5200, 10):
        bench.sample(at)
    bench.joint(ms)
    for at in range(5200, 5400, 10):
        bench.sample(at)
    assert bench.answered() == list(range(5000, 5400, 10))
    assert {t.state for t in bench.tracking} == {'tracking'}
    reason = 'stamp jumps by # s, and none agrees with it; check the clock'
    assert bench.node.health.rejected == {('/joint_states', reason): 1}


def test_a_motion_is_joined_from_a_moving_arm_without_a_jerk(bench):
    bench.sample(0, q=(0.5, 0.0, 0.0), qd=(0.2, 0.0, -0.1))
    assert_allclose(bench.tracking[0].reference_velocity, [0.2, 0.0, -0.1], atol=1e-12)
    assert_allclose(bench.tracking[0].velocity_error, 0.0, atol=1e-12)
    for ms in range(100, 5000, 100):
        bench.sample(ms, q=(0.5, 0.0, 0.0))
    assert_allclose(bench.tracking[-1].reference_velocity, 0.0, atol=1e-9)


def test_a_clock_that_jumps_back_starts_the_motion_again(bench):
    restarted, restart = [], bench.node.restart
    bench.node.restart = lambda why: [restarted.append(why), restart(why)]
    bench.sample(5000)
    bench.rig.set_time(0)
    assert restarted == []  # /clock alone may be wrong
    bench.sample(10)
    assert bench.answered()[-1] == 10
    assert restarted == ['/clock went back']


def estimate(bench, **changes):
    from spacerobot_ros.estimation.unknowns.minimal import minimal_set
    from spacerobot_ros.identification.estimate import Estimate

    robot = bench.node.loop.robot
    minimal = minimal_set(robot, 'symmetric')
    parameters = minimal.of_robot(robot)
    size = 3 + len(parameters)
    message = convert.estimate_message(
        Estimate(
            method='ml', valid=True, reason='', aam_links=('link_3',),
            aam=np.array([42.0, 49.0, 41.0]), parameter_names=minimal.names,
            parameters=parameters, covariance=np.eye(size), rank=size, unknowns=size,
            condition=1.0, unexcited=(), total_momentum=np.zeros(3),
            total_momentum_covariance=np.eye(3), chi2_per_dof=1.0, samples=1, stamp_ns=0,
            units=minimal.units,
        ),
        0,
    )  # fmt: skip
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_a_valid_estimate_changes_the_torque(bench):
    bench.sample(0)
    bench.estimates.publish(estimate(bench))
    bench.rig.deliver()
    bench.sample(10)
    assert bench.tracking[-1].uses_estimate
    difference = np.subtract(bench.commands[1].effort, bench.commands[0].effort)
    assert np.abs(difference).max() > 0.5
    assert 'running on an estimate' in bench.status('estimate').message


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'covariance': (-np.eye(22)).ravel().tolist()}, 'negative variance'),
        ({'covariance': [1.0]}, 'covariance has # entries, expected #'),
        ({'aam': [np.nan, 0.0, 0.0]}, 'not finite'),
        ({'aam_links': ['link_2']}, 'link_2'),
        ({'parameter_names': ['x'] * 19}, 'parameters'),
        ({'parameters': [-1.0] * 19}, 'positive'),
    ],
)
def test_bad_estimates_are_counted_and_not_used(bench, changes, reason):
    bench.estimates.publish(estimate(bench, **changes))
    bench.rig.deliver()
    counted = [r for (topic, r), n in bench.node.health.rejected.items() if topic == '/estimate']
    assert len(counted) == 1
    assert reason in counted[0]
    bench.sample(0)
    assert not bench.tracking[-1].uses_estimate


@pytest.mark.parametrize('changes', [{'aam': [1e6, 0.0, 0.0]}, {'parameters': [1e9] * 19}])
def test_estimates_beyond_what_the_robot_file_thinks_possible(bench, changes):
    bench.estimates.publish(estimate(bench, **changes))
    bench.rig.deliver()
    assert bench.node.health.count('/estimate') == 1
    bench.sample(0)
    assert not bench.tracking[-1].uses_estimate


def test_an_estimate_that_contradicts_the_last_one_needs_another_that_agrees(bench):
    def send(first):
        bench.estimates.publish(estimate(bench, aam=[first, 49.0, 41.0]))
        bench.rig.deliver()
        used = bench.node.loop.estimate
        return None if used is None else used.aam[0]

    # standard deviations of 1 N m s
    assert [send(x) for x in (42.0, 45.0, 90.0, 45.5)] == [42.0, 45.0, 45.0, 45.5]
    assert [send(x) for x in (90.0, 10.0, 90.0, 91.0)] == [45.5, 45.5, 45.5, 91.0]


def test_an_estimate_that_is_not_valid_leaves_the_last_valid_one(bench):
    bench.estimates.publish(estimate(bench))
    bench.rig.deliver()
    bench.estimates.publish(estimate(bench, valid=False, reason='too early'))
    bench.rig.deliver()
    bench.sample(0)
    assert bench.tracking[-1].uses_estimate
    assert bench.node.health.count() == 0
    assert 'not valid: too early' in bench.status('estimate').message


def reference(times, positions, names=NAMES, rates=None, more=None):
    message = JointTrajectory(joint_names=list(names))
    for k, (t, q) in enumerate(zip(times, positions, strict=True)):
        point = JointTrajectoryPoint(positions=[float(x) for x in q])
        point.time_from_start.sec = t
        point.velocities = [] if rates is None else [float(x) for x in rates[k]]
        point.accelerations = [] if more is None else [float(x) for x in more[k]]
        message.points.append(point)
    return message


def test_a_trajectory_is_followed_from_where_the_motion_is(bench):
    bench.sample(0)
    bench.references.publish(reference([2], [(0.1, 0.2, 0.3)]))
    bench.rig.deliver()
    for k in range(1, 31):
        bench.sample(100 * k)
    first, last = bench.tracking[1], bench.tracking[-1]
    assert_allclose(first.reference_position, 0.0, atol=1e-3)
    assert_allclose(last.reference_position, [0.1, 0.2, 0.3], atol=1e-12)
    assert bench.node.loop.mode == 'tracking'  # joined smoothly until 4 / bandwidth


@pytest.mark.parametrize(
    'message',
    [
        reference([1], [(0.0, 0.0)], names=NAMES[:2]),
        reference([1], [(np.nan, 0.0, 0.0)]),
        reference([2, 1], [(0.0,) * 3] * 2),
        reference([], []),
        reference([1], [(1e308, 0.0, 0.0)]),
        reference([0], [(-1e308, 0.0, 0.0)], rates=[(0.2, 0.0, 0.0)]),
        reference([1, 2], [(1e308, 0.0, 0.0), (-1e308, 0.0, 0.0)]),
        reference([1, 2, 3], [(0.0,) * 3] * 3, rates=[(1e308,) * 3] * 3),
        reference([1, 2], [(0.0,) * 3] * 2, rates=[(0.1,) * 3] * 2, more=[(1e308,) * 3] * 2),
        reference([10], [(1e6, 0.0, 0.0)]),
        reference([1], [(0.0, 0.0, 2.0)]),  # on the way faster than the URDF's 2 rad/s
        reference([1, 2], [(0.0,) * 3] * 2, rates=[(2.1, 0.0, 0.0)] * 2),
    ],
)
def test_bad_trajectories_are_counted(bench, message):
    bench.sample(0)
    bench.references.publish(message)
    bench.rig.deliver()
    assert bench.node.health.count('/reference') == 1
    bench.sample(10)
    assert bench.answered() == [0, 10]
    assert_allclose(bench.tracking[-1].reference_position, 0.0, atol=0)


def test_a_joint_stays_within_its_range(rig, servicer):
    from pathlib import Path

    urdf = Path('config/servicer.urdf').read_text(encoding='utf-8')
    urdf = urdf.replace('<limit effort', '<limit lower="-1" upper="1.5" effort')
    kinds = (('continuous', 'revolute'),)
    for old, new in kinds:
        urdf = urdf.replace(f'type="{old}"', f'type="{new}"')
    bench = Bench(rig, servicer, **{'robot_description': urdf, 'robot.urdf': ''})
    bench.sample(0)
    for q, refused in ((1.4, 0), (1.6, 1), (-1.1, 2)):
        bench.references.publish(reference([60], [(q, 0.0, 0.0)]))
        bench.rig.deliver()
        assert bench.node.health.count('/reference') == refused


@pytest.mark.parametrize('start', [0.0, -1.0])
def test_a_motion_of_the_robot_file_beyond_the_limits_is_told_once(rig, servicer, capfd, start):
    motion = {'reference.kind': 'set_point', 'reference.set_point': [2.0 + start, 1.5, 0.0]}
    bench = Bench(rig, servicer, **motion, **{'reference.duration': 1.8})
    for ms in (0, 10, 20):  # 1.875 (2 + start) / 1.8 rad/s from zero, that of 2 from there
        bench.sample(ms, q=(start, 0.0, 0.0))
    told = [line for line in capfd.readouterr().err.splitlines() if 'reference: ' in line]
    assert len(told) == 1
    assert 'joint_1 would move at 2.08333 rad/s, its limit is 2 rad/s' in told[0]


def test_lockstep_waits_for_the_gyro_of_the_same_stamp(rig, servicer):
    bench = Bench(rig, servicer, **LOCKSTEP)
    bench.joint(0)
    assert bench.commands == []
    bench.gyro(0)
    assert bench.answered() == [0]
    bench.gyro(10)
    bench.joint(10)
    assert bench.answered() == [0, 10]
    bench.joint(20)  # a gyro that stopped must not stop time: answered without it in the end
    rig.until(lambda: bench.later() and bench.answered() == [0, 10, 20])


def test_joints_that_waited_and_can_not_be_answered_end_nothing(rig, servicer):
    bench = Bench(rig, servicer, **LOCKSTEP)
    bench.joint(0, qd=(1e200, 0.0, 0.0))  # no gyro comes: a timer answers
    rig.until(lambda: bench.later() and bench.node.health.count('/joint_states') == 1)
    bench.joint(10, qd=(1e200, 0.0, 0.0))
    bench.gyro(10)
    assert bench.node.health.count('/joint_states') == 2
    assert bench.node.health.count() == 2
    bench.gyro(20)
    bench.joint(20)
    assert bench.answered() == [20]


def test_a_repeated_sample_gets_its_answer_again(bench):
    bench.sample(0)
    bench.joint(0)
    assert bench.answered() == [0, 0]
    assert bench.commands[0] == bench.commands[1]


def test_who_was_silent_for_long_gets_its_answer_again(bench):
    bench.sample(0)
    bench.wall.ms = 500
    bench.rig.until(lambda: bench.answered()[-1] == 500)  # a guess, for a stamp of its own
    bench.joint(0)
    bench.rig.until(lambda: bench.answered().count(0) == 2)
    again = len(bench.commands) - 1 - bench.answered()[::-1].index(0)
    assert bench.commands[again] == bench.commands[0]


def test_saturation_is_reported(rig, servicer):
    bench = Bench(rig, servicer, **{'controller.torque_limit': [1e9, 1e-3, 1e9]})
    bench.sample(0)
    assert bench.tracking[0].saturated[1]
    assert abs(bench.commands[0].effort[1]) == 1e-3
    assert 'torque at its limit' in bench.status('control').message
