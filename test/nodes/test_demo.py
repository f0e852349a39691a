"""`spacerobot demo` from end to end."""

import itertools
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from spacerobot_ros.cli.main import main
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.recording.bags.message_types import decoded, encoded, typestore

pytestmark = [pytest.mark.ros, pytest.mark.slow]

TOPICS = {
    '/attitude', '/clock', '/estimate', '/imu/data', '/joint_commands', '/joint_states',
    '/robot_description', '/simulator/ledger', '/tracking',
}  # fmt: skip
QUICK = (  # its motion in 8 s instead of 20, at 50 Hz: as informative and still 70 times better
    ('duration: 20.0', 'duration: 8.0'),
    ('period: 0.01', 'period: 0.02'),
    ('joint_rate: 100.0', 'joint_rate: 50.0'),
    ('imu_rate: 100.0', 'imu_rate: 50.0'),
)
COARSE = (  # at 20 Hz, with a tenth of the solutions: still 250 times better
    ('period: 0.01', 'period: 0.05'),
    ('joint_rate: 100.0', 'joint_rate: 20.0'),
    ('imu_rate: 100.0', 'imu_rate: 20.0'),
    ('structure: generic', 'solve_period: 10.0'),
)


def changed(file, changes):
    text = Path(file).read_text(encoding='utf-8')
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return text


@pytest.mark.parametrize(
    ('name', 'changes', 'link', 'truth'),
    [
        ('servicer', QUICK, 'link_3', [42.0, 49.0, 41.0]),
        ('seven_joints', COARSE, 'client', [1.6, -1.1, 1.9]),
    ],
)
def test_the_demo_reaches_its_aims_and_leaves_what_it_promises(
    tmp_path, capsys, name, changes, link, truth
):
    out, robot = tmp_path / 'demo', tmp_path / 'robot.yaml'
    robot.write_text(changed(f'config/{name}.yaml', changes), encoding='utf-8')
    assert main(['demo', '--quick', '--robot', str(robot), '--out', str(out)]) == 0
    summary = json.loads((out / 'summary.json').read_text(encoding='utf-8'))
    assert set(summary) == {
        'aam', 'parameters', 'tracking_max_deg', 'momentum_drift_relative', 'bag', 'wall_s'
    }  # fmt: skip
    assert set(summary['aam']) == {'value', 'std', 'truth', 'max_error_percent'}
    assert summary['aam']['truth'] == truth
    error = np.subtract(summary['aam']['value'], summary['aam']['truth'])
    assert np.all(np.abs(error) < 5.0 * np.array(summary['aam']['std']))
    assert summary['aam']['max_error_percent'] < 1.0
    tracking = summary['tracking_max_deg']
    assert tracking['no_aam'] > 50.0 * tracking['identified']
    assert summary['momentum_drift_relative'] < 1e-10
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert page.index('<h1>The captured wheels hold') < page.index(f'identified, {link}')
    assert page.count('<div class="live"') == 4
    assert all(f'error of {joint}' in page for joint in load_robot_file(robot).robot.arm)
    assert f'{link}, x' in capsys.readouterr().out
    with AnyReader([out / 'bag'], default_typestore=typestore()) as bag:
        assert {c.topic for c in bag.connections} == TOPICS
        stamps = [stamp for _, stamp, _ in bag.messages()]
    assert stamps == sorted(stamps)


def test_the_first_pass_is_the_motion_tracked_without_the_wheels(tmp_path):
    """To the last bit; the very last command is that of a motion that goes on."""
    from spacerobot_ros.demo import run

    file = load_robot_file('config/servicer.yaml')
    file = replace(file, settings=file.settings.changed({'reference.duration': 1.0}))
    settings = run._settings(file, 'computed_torque_no_aam', 2)
    twice = run._run(file, settings, 2, [tmp_path / 'twice', tmp_path / 'first'], None)
    once = run.track(file, None, tmp_path / 'once')
    assert twice.time[-1] == 2.0
    for name in ('time', 'error', 'ledger_time', 'angular', 'drift', 'energy_drift'):
        np.testing.assert_array_equal(getattr(twice.until(1.0), name), getattr(once, name))
    kept = []
    for name in ('first', 'once'):
        with AnyReader([tmp_path / name], default_typestore=typestore()) as bag:
            assert {c.topic for c in bag.connections} == TOPICS - {'/estimate'}
        kept.append(messages_of(tmp_path / name))
    differ = {(a[0], a[1]) for a, b in zip(*kept, strict=True) if a != b}
    assert {stamp for _, stamp in differ} <= {1_000_000_000}, differ


WHEELS = ('links: [link_3], momentum: [0.0, 0.0, 0.0]', 'links: []')
TRUTH = ('target_momentum: [42.0, 49.0, 41.0]', 'links: []')
STILL = [
    ('sine: [0.1234', 'sine: [0, 0, 0, 0, 0, 0, 0, 0, 0] # '),
    ('cosine: [0.1600', 'cosine: [0, 0, 0, 0, 0, 0, 0, 0, 0] # '),
]
JOINTLESS = [('joints: [joint_1, joint_2, joint_3]', 'joints: []')]
FIXED = [('type="continuous"', 'type="fixed"')]
SLIDES = [
    ('name="joint_3" type="continuous"', 'name="joint_3" type="prismatic"'),
    ('<limit ', '<limit lower="-1" upper="1" '),
]


@pytest.mark.parametrize(
    ('changes', 'urdf', 'place', 'reason'),
    [
        ([('base: free', 'base: fixed')], [], 'robot.base', 'needs a free base'),
        (JOINTLESS, FIXED, 'robot.joints', 'needs joints'),
        ([], SLIDES, 'robot.joints', "'joint_3' slides"),
        ([WHEELS, TRUTH], [], 'robot.target_wheels', 'captured body'),
        ([TRUTH], [], 'truth.target_momentum', 'at rest'),
        ([('kind: fourier', 'kind: hold')], [], 'reference.kind', '`spacerobot excite`'),
        ([('harmonics: 3', 'harmonics: 2')], [], 'reference.sine', 'expected 6 numbers'),
        (STILL, [], 'reference.sine', 'all joints stand still'),
        ([('joint_rate: 100.0', 'joint_rate: 50.0')], [], 'simulator.joint_rate', 'control rate'),
    ],
)
def test_a_robot_with_nothing_to_show_is_refused(tmp_path, capsys, changes, urdf, place, reason):
    given, out = tmp_path / 'given', tmp_path / 'out'
    given.mkdir()
    out.mkdir()
    local = ('package://spacerobot_ros/config/servicer.urdf', 'servicer.urdf')
    for name, own in (('servicer.urdf', urdf), ('servicer.yaml', [local, *changes])):
        (given / name).write_text(changed(f'config/{name}', own), encoding='utf-8')
    (out / 'summary.json').write_text('before')
    assert main(['demo', '--robot', str(given / 'servicer.yaml'), '--out', str(out)]) == 2
    assert (out / 'summary.json').read_text() == 'before'
    assert {path.name for path in tmp_path.iterdir()} == {'out', 'given'}
    error = capsys.readouterr().err.strip()
    assert f'{place}: ' in error
    assert reason in error
    assert '\n' not in error


def messages_of(bag):
    """Topics, stamps and contents; what is in the gaps between numbers is chance."""
    with AnyReader([bag], default_typestore=typestore()) as reader:
        return [
            (c.topic, stamp, encoded(decoded(c.msgtype, bytes(data))))
            for c, stamp, data in reader.messages()
        ]


def test_delays_change_no_message(tmp_path, monkeypatch):
    """A machine on which half a minute goes by between two looks at the clock."""
    from spacerobot_ros.demo.run import track
    from spacerobot_ros.nodes import base

    file = load_robot_file('config/servicer.yaml')
    file = replace(file, settings=file.settings.changed({'reference.duration': 1.0}))
    calm = track(file, None, tmp_path / 'calm')
    late = itertools.count(0, 30_000_000_000)
    monkeypatch.setattr(base.RobotNode, 'wall_ns', staticmethod(lambda: next(late)))
    busy = track(file, None, tmp_path / 'busy')
    sent = messages_of(tmp_path / 'calm')
    assert sorted(sent) == sorted(messages_of(tmp_path / 'busy'))
    each = Counter(topic for topic, *_ in sent)
    assert {t: each[t] for t in ('/clock', '/joint_states', '/imu/data', '/tracking')} == (
        dict.fromkeys(('/clock', '/joint_states', '/imu/data', '/tracking'), 101)
    )
    np.testing.assert_array_equal(calm.error, busy.error)


def test_wheels_at_rest_are_a_valid_answer_of_the_nodes(tmp_path):
    from spacerobot_ros.demo.run import identify

    file = load_robot_file('config/servicer.yaml')
    changes = {'reference.duration': 12.0, 'truth.target_momentum': (0.0, 0.0, 0.0)}
    file = replace(file, settings=file.settings.changed(changes))
    estimate = identify(file, 1, [tmp_path / 'bag'], lambda *_: None).estimates[-1]
    assert estimate.valid, estimate.reason
    std = estimate.std[:3]
    assert np.max(std) < 0.1  # where wheels that spin have 76 N m s
    assert np.max(np.abs(estimate.aam) / std) < 4.0
