"""Robot files: what loads, and what is refused with the place named."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.models import Part, robot_of, settings_of, table_one, to_urdf

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import initial_state
from spacerobot_ros.effects.motion import inverse_mass
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.files import write_text, written_whole
from spacerobot_ros.model.loader import build_robot, resolve_urdf
from spacerobot_ros.model.motion_settings import InitialSettings
from spacerobot_ros.model.settings import TruthSettings, parse_settings
from spacerobot_ros.model.urdf import parse_urdf
from spacerobot_ros.model.writer import urdf_text
from spacerobot_ros.simulation.replay.shapes import shapes_of
from spacerobot_ros.simulation.truth import true_robot

SERVICER = Path(__file__).parents[2] / 'config' / 'servicer.yaml'
TEXT = """/**:
  ros__parameters:
    robot:
      urdf: robot.urdf
      joints: [j_link_1, j_link_2, j_link_3]
      servicer_wheels: {momentum: [25.0, 27.0, 28.0]}
      target_wheels: {links: [link_3]}
    sensors: {gyro_std: 2.0e-5}
    initial: {attitude_xyzw: [0.0, 0.0, 0.0, 1.0]}
    truth: {target_momentum: [42.0, 49.0, 41.0]}
"""


@pytest.fixture
def load(tmp_path):
    """Write a robot file beside its URDF and load it."""

    def write_and_load(text: str, urdf: str | None = None):
        (tmp_path / 'robot.urdf').write_text(urdf if urdf is not None else to_urdf(table_one()))
        path = tmp_path / 'robot.yaml'
        path.write_text(text)
        return load_robot_file(path)

    return write_and_load


def test_every_config_loads():
    for path in SERVICER.parent.glob('*.yaml'):
        file = load_robot_file(path)
        true_robot(file.robot, file.settings)


def test_servicer_is_table_one():
    robot = load_robot_file(SERVICER).robot
    expected = robot_of(table_one('zyx'))
    np.testing.assert_array_equal(robot.inertial_parameters, expected.inertial_parameters)
    for body, other in zip(robot.bodies, expected.bodies, strict=True):
        np.testing.assert_array_equal(body.translation, other.translation)
        np.testing.assert_array_equal(body.axis, other.axis)


def test_the_base_is_the_root_of_the_urdf_where_no_name_is_given(load):
    urdf = to_urdf(table_one()).replace('"base_link"', '"bus"')
    assert load(TEXT, urdf).robot.base_link == 'bus'


def test_relative_urdf_lies_beside_the_file(load):
    file = load(TEXT)
    assert file.robot.joints == ('j_link_1', 'j_link_2', 'j_link_3')
    assert file.settings.sensors.gyro_std == 2.0e-5
    assert file.settings.sensors.joint_position_std is None
    np.testing.assert_array_equal(file.robot.target_momentum, np.zeros(3))
    np.testing.assert_array_equal(
        true_robot(file.robot, file.settings).target_momentum, [42.0, 49.0, 41.0]
    )


def test_efforts_and_noise_for_all_joints_or_for_each(load):
    one = load(TEXT.replace('{gyro_std', '{joint_effort_std: 0.2, gyro_std')).robot
    assert one.effort_kinds == ('motor',) * 3
    assert one.sensors.std('joint_effort') == 0.2
    np.testing.assert_array_equal(one.effort_units, np.ones(3))
    text = TEXT.replace('{gyro_std', '{joint_effort_std: [0.3, 0.4, 0.0001], gyro_std')
    kinds = 'effort_kind: [link, current, motor]\n      motor_constant: 12.5\n      urdf: '
    each = load(text.replace('urdf: ', kinds)).robot
    assert each.effort_kinds == ('link', 'current', 'motor')
    assert each.sensors.joint_effort_std == (0.3, 0.4, 0.0001)
    # root of the mean square: 0.5 / sqrt(3), the third adds 2e-8 of it
    np.testing.assert_allclose(each.sensors.std('joint_effort'), 0.5 / 3**0.5, rtol=1e-7, atol=0)
    assert each.sensors.std('joint_velocity') is None
    np.testing.assert_array_equal(each.effort_units, [1.0, 12.5, 1.0])


def test_exponent_without_a_point_is_a_number_as_in_ros(load):
    assert load(TEXT.replace('2.0e-5', '2e-5')).settings.sensors.gyro_std == 2.0e-5


FILES = [
    ('malformed', '/**: [', 'robot.yaml: not valid YAML'),
    ('tab', '/**:\n\tros__parameters: 1', 'robot.yaml: not valid YAML'),
    ('key twice', TEXT + '    truth: {}\n', "not valid YAML: key 'truth' is given twice"),
    ('list as key', '? [a]\n: 1', 'not valid YAML: .* unhashable key'),
    ('empty', '', r"robot.yaml: expected one entry '/\*\*'"),
    ('list', '- 1', r"robot.yaml: expected one entry '/\*\*'"),
    ('two nodes', 'a: {}\nb: {}', r"robot.yaml: expected one entry '/\*\*'"),
    ('no parameters', '/**: {}', r'robot.yaml: /\*\*: expected ros__parameters'),
    (
        'parameters list',
        '/**: {ros__parameters: [1]}',
        r'ros__parameters: expected a map of parameters, got \[1\]',
    ),
    (
        'parameters null',
        '/**: {ros__parameters: }',
        'ros__parameters: expected a map of parameters, got None',
    ),
    (
        'no robot',
        '/**: {ros__parameters: {}}',
        r'robot.yaml: robot: required parameter is missing',
    ),
    (
        'no joints',
        '/**: {ros__parameters: {robot: {}}}',
        r'robot.joints: required parameter is missing',
    ),
    (
        'unknown section',
        TEXT + '    sensor: {}\n',
        r"robot.yaml: sensor: unknown parameter \(did you mean 'sensors'\?\)",
    ),
    (
        'unknown key',
        TEXT.replace('joints:', 'jionts:'),
        r"robot.jionts: unknown parameter \(did you mean 'joints'\?\)",
    ),
    (
        'unknown key below',
        TEXT.replace('momentum: [25', 'moment: [25'),
        r"servicer_wheels.moment: unknown .*'momentum'",
    ),
    ('nothing close', TEXT + '    zzz: {}\n', r'zzz: unknown parameter \(known: adaptive, '),
    (
        'section null',
        TEXT + '    simulator:\n',
        'simulator: expected a map of parameters, got None',
    ),
    (
        'effort kind',
        TEXT.replace('urdf: ', 'effort_kind: [motor, torque, link]\n      urdf: '),
        r"robot.effort_kind\[1\]: 'torque' is not one of motor, link, current, gravity_comp",
    ),
    (
        'effort kinds of two',
        TEXT.replace('urdf: ', 'effort_kind: [motor, link]\n      urdf: '),
        'robot.effort_kind: expected one for all joints, or a list of 3; got a list of 2',
    ),
    (
        'motor constant',
        TEXT.replace('urdf: ', 'motor_constant: [1.0, 0.0, 2.0]\n      urdf: '),
        r'robot.motor_constant\[1\]: 0 N m/A must be above 0',
    ),
    (
        'noise of two joints',
        TEXT.replace('{gyro_std', '{joint_effort_std: [0.1, 0.2], gyro_std'),
        'sensors.joint_effort_std: expected one for all joints, or a list of 3; got a list of 2',
    ),
    (
        'noise of no joint',
        TEXT.replace('{gyro_std', '{joint_effort_std: [], gyro_std'),
        'sensors.joint_effort_std: expected one for all joints, or a list of 3; got a list of 0',
    ),
    ('NaN', TEXT.replace('27.0', '.nan'), r'servicer_wheels.momentum\[1\]: nan is not a finite'),
    ('infinite', TEXT.replace('2.0e-5', '.inf'), r'sensors.gyro_std: inf is not a finite'),
    (
        'beyond floats',
        TEXT.replace('2.0e-5', '1' + 400 * '0'),
        r'sensors.gyro_std: 10+ is not a finite',
    ),
    (
        'text for number',
        TEXT.replace('2.0e-5', 'small'),
        "sensors.gyro_std: expected a number, got 'small'",
    ),
    (
        'number for text',
        TEXT.replace('urdf: robot.urdf', 'urdf: 3'),
        'robot.urdf: expected text, got 3',
    ),
    (
        'bool for number',
        TEXT.replace('2.0e-5', 'true'),
        'sensors.gyro_std: expected a number, got True',
    ),
    (
        'number for bool',
        TEXT + '    simulator: {noise: 1}\n',
        'simulator.noise: expected true or false, got 1',
    ),
    (
        'fraction for whole',
        TEXT + '    simulator: {seed: 1.5}\n',
        'simulator.seed: expected a whole number, got 1.5',
    ),
    (
        'text for list',
        TEXT.replace('[j_link_1, j_link_2, j_link_3]', 'j_link_1'),
        'robot.joints: expected a list',
    ),
    (
        'map for list',
        TEXT.replace('[j_link_1, j_link_2, j_link_3]', '{j_link_1: 0}'),
        'robot.joints: expected a list',
    ),
    (
        'number in texts',
        TEXT.replace('[j_link_1,', '[1,'),
        r'robot.joints\[0\]: expected text, got 1',
    ),
    (
        'not positive',
        TEXT.replace('2.0e-5', '0.0'),
        'sensors.gyro_std: 0 rad/s must be above 0',
    ),
    (
        'too small',
        TEXT + '    simulator: {substeps: 0}\n',
        'simulator.substeps: 0 must be at least 1',
    ),
    (
        'next to nothing',
        TEXT + '    adaptive: {kappa: 1.0e-300}\n',
        'adaptive.kappa: 0 1/s must be above 0',
    ),
    (
        'no number of anything',
        TEXT.replace('2.0e-5', '1.0e+308'),
        r'sensors.gyro_std: 1e\+308 is not a finite number of a magnitude up to 1e\+50',
    ),
    (
        'too large',
        TEXT + '    simulator: {period: 2.0}\n',
        'simulator.period: 2 s must be at most 1',
    ),
    (
        'not a choice',
        TEXT + '    controller: {law: pid}\n',
        "controller.law: 'pid' is not one of computed_torque, ",
    ),
    (
        'wrong length',
        TEXT.replace('0.0, 1.0]}', '1.0]}'),
        'initial.attitude_xyzw: expected 4 numbers, got 3',
    ),
    ('no URDF', TEXT.replace('robot.urdf', 'none.urdf'), 'robot.urdf: no such file: .*none.urdf'),
    (
        'unknown package',
        TEXT.replace('robot.urdf', 'package://nowhere/r.urdf'),
        "package 'nowhere' is not on AMENT_PREFIX_PATH",
    ),
    (
        'package nameless',
        TEXT.replace('robot.urdf', 'package:///r.urdf'),
        'robot.urdf: package:// needs a package name',
    ),
    (
        'URDF not given',
        TEXT.replace('robot.urdf', '""'),
        'robot.urdf: is missing: give package://',
    ),
    (
        'unknown joint',
        TEXT.replace('j_link_2', 'j_link_9'),
        r"robot.joints\[1\]: the URDF has no moving joint 'j_link_9'",
    ),
    (
        'joint twice',
        TEXT.replace('j_link_2', 'j_link_1'),
        r"robot.joints\[1\]: joint 'j_link_1' is named twice",
    ),
    (
        'joint not listed',
        TEXT.replace('j_link_2, ', ''),
        "robot.joints: joint 'j_link_2' of the URDF moves but is not named",
    ),
    (
        'no joint',
        TEXT.replace('[j_link_1, j_link_2, j_link_3]', '[]'),
        "'j_link_1' of the URDF moves but is not named: .*: {j_link_1: 0.0}; so do 'j_link_2",
    ),
    (
        'base link',
        TEXT.replace('urdf: r', 'base_link: hub\n      urdf: r'),
        "robot.base_link: 'hub' is not the root link 'base_link'",
    ),
    (
        'base kind',
        TEXT.replace('urdf: r', 'base: floating\n      urdf: r'),
        "robot.base: 'floating' is not one of free, fixed",
    ),
    (
        'gravity',
        TEXT.replace('urdf: r', 'gravity: [9.81]\n      urdf: r'),
        'robot.gravity: expected 3 numbers, got 1',
    ),
    (
        'target link',
        TEXT.replace('links: [link_3]', 'links: [link_9]'),
        r"target_wheels.links\[0\]: the URDF has no link 'link_9'",
    ),
    (
        'target link twice',
        TEXT.replace('links: [link_3]', 'links: [link_3, link_3]'),
        r"robot.target_wheels.links\[1\]: 'link_3' is named twice",
    ),
    (
        'momentum a link',
        TEXT.replace('links: [link_3]', 'links: [link_3], momentum: [1.0]'),
        r'robot.target_wheels.momentum: expected three a link \(3\), got 1',
    ),
    (
        'servicer momentum',
        TEXT.replace('[25.0, 27.0, 28.0]', '[25.0]'),
        r'robot.servicer_wheels.momentum: expected three a link \(3\), got 1',
    ),
    (
        'servicer link',
        TEXT.replace('{momentum: [25', '{links: [link_1], momentum: [25'),
        "robot.servicer_wheels.links: the servicer's wheels are on 'base_link'",
    ),
    (
        'rates without rotors',
        TEXT.replace('{momentum: [25', '{rates: [1.0], momentum: [25'),
        r'servicer_wheels.rates: expected 0',
    ),
]


@pytest.mark.parametrize(
    ('text', 'match'), [case[1:] for case in FILES], ids=[case[0] for case in FILES]
)
def test_file_refusals_name_their_place(load, text, match):
    with pytest.raises(ConfigurationError, match=match) as caught:
        load(text)
    assert '\n' not in str(caught.value)


def test_unreadable_files(tmp_path):
    with pytest.raises(ConfigurationError, match=r'none\.yaml: robot file can not be read'):
        load_robot_file(tmp_path / 'none.yaml')
    with pytest.raises(ConfigurationError, match='robot file can not be read'):
        load_robot_file(tmp_path)
    binary = tmp_path / 'binary.yaml'
    binary.write_bytes(b'\xff\xfe\x00\x80')
    with pytest.raises(ConfigurationError, match=r'binary\.yaml: robot file is not UTF-8'):
        load_robot_file(binary)


HOSTILE = {
    'tag': ('!!int abc', "'abc' is no int"),
    'empty tag': ('!!int ""', "'' is no int"),
    'float tag': ('!!float abc', "'abc' is no float"),
    'bool tag': ('!!bool abc', "'abc' is no bool"),
    'date tag': ('!!timestamp abc', "'abc' is no timestamp"),
    'date': ('2024-01-99', "'2024-01-99' is no timestamp"),
    'digits': ('9' * 5000, r"'9{56} \.\.\.' is no int"),
    'hexadecimal': ('0x' + 'f' * 5000, r"'0xf{54} \.\.\.' is no int"),
    'python': ('!!python/object/apply:os.getcwd []', 'could not determine a constructor'),
    'deep list': ('[' * 100_000, 'more than 50 levels of lists or maps'),
    'deep map': ('{a: ' * 100_000, 'more than 50 levels of lists or maps'),
    'alias': ('[&a 1, *a]', r'alias \*a: not known in ROS 2'),
    'itself': ('&a [*a]', r'alias \*a: not known in ROS 2'),
    'list as key': ('{[1]: 2}', 'found unhashable key'),
    'long text': ('a' * 100_000, r'expected a number, got .a{700,} \.\.\.$'),
}


@pytest.mark.parametrize(('value', 'match'), HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_values_are_one_line(load, value, match):
    with pytest.raises(ConfigurationError, match=match) as caught:
        load(f'/**:\n  ros__parameters:\n    robot:\n      inertia_uncertainty: {value}\n')
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) <= 1000


def test_what_is_no_file_or_too_large_is_not_read(load, tmp_path):
    load(TEXT)
    os.mkfifo(tmp_path / 'pipe.yaml')
    for path in (tmp_path / 'pipe.yaml', '/dev/zero'):
        with pytest.raises(ConfigurationError, match='can not be read: it is not a file'):
            load_robot_file(path)
    (tmp_path / 'large.yaml').write_bytes(b'# ' * 600_000)
    with pytest.raises(ConfigurationError, match='is larger than 1 MB, the most that is read'):
        load_robot_file(tmp_path / 'large.yaml')
    large = '<robot>' + '<link name="a"/>' * 300_000 + '</robot>'
    with pytest.raises(ConfigurationError, match='is larger than 4 MB, the most that is read'):
        load(TEXT, large)
    with pytest.raises(ConfigurationError, match='robot_description: is larger than 4 MB'):
        parse_urdf(large, 'robot_description')
    with pytest.raises(ConfigurationError, match='has 501 joints; the most is 500'):
        build_robot(parse_settings({'robot': {'joints': ['a'] * 501}}), to_urdf(table_one()))


@pytest.mark.parametrize('name', ['x' * 5000, 'a\\0b'], ids=['long', 'null'])
def test_a_name_that_no_file_can_have_is_one_line(load, name):
    with pytest.raises(ConfigurationError, match=r'robot\.urdf: no such file') as caught:
        load(TEXT.replace('urdf: robot.urdf', f'urdf: "{name}"'))
    assert '\n' not in str(caught.value)


def test_only_files_are_written_over(tmp_path):
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    with pytest.raises(ConfigurationError, match='can not be written: it is not a file'):
        write_text(pipe, 'x')
    assert pipe.is_fifo()


def test_an_axis_beyond_all_bounds_is_one_line(load):
    with pytest.raises(ConfigurationError, match=r'must be a unit vector, its length is 1e\+40'):
        load(TEXT, to_urdf(table_one()).replace('<axis xyz="0.0', '<axis xyz="1e40'))


def test_a_urdf_in_another_encoding_is_one_line(load, tmp_path):
    load(TEXT)
    text = '<?xml version="1.0" encoding="ISO-8859-1"?><robot name="\xe9"/>'
    (tmp_path / 'robot.urdf').write_bytes(text.encode('latin-1'))
    with pytest.raises(ConfigurationError, match=r'robot\.urdf is not UTF-8 \(byte 56\): save it'):
        load_robot_file(tmp_path / 'robot.yaml')


@pytest.mark.parametrize(
    'text',
    [
        '<a>' * 100_000,
        '<robot>' + '<a>' * 100_000 + '</a>' * 100_000 + '</robot>',
        '<?xml version="1.0" encoding="none"?><robot/>',
        '\0',
        '<!DOCTYPE r [<!ENTITY a "' + 'b' * 10_000 + '"><!ENTITY c "' + '&a;' * 1000
        + '">]><robot name="' + '&c;' * 1000 + '"/>',
    ],
    ids=['open', 'deep', 'encoding', 'null', 'entities'],
)  # fmt: skip
def test_hostile_xml_is_one_line(load, text):
    with pytest.raises(ConfigurationError) as caught:
        load(TEXT, text)
    assert '\n' not in str(caught.value)


def test_a_folder_changes_when_all_is_written_and_not_before(tmp_path):
    out = tmp_path / 'out'
    (out / 'bag').mkdir(parents=True)
    (out / 'bag' / 'old').write_text('')
    (out / 'own').write_text('stays')

    def write(error=None):
        with written_whole(out) as work:
            (work / 'bag').mkdir(parents=True)
            (work / 'summary').write_text('new')
            if error:
                raise error

    for error in (KeyboardInterrupt(), ConfigurationError('a', 'b')):
        with pytest.raises(type(error)):
            write(error)
        assert (out / 'bag' / 'old').exists()
        assert not (out / 'summary').exists()
    write()
    assert not list((out / 'bag').iterdir())
    assert (out / 'summary').read_text() == 'new'
    assert (out / 'own').read_text() == 'stays'
    assert list(tmp_path.iterdir()) == [out]


def test_urdf_errors_name_the_file(load):
    with pytest.raises(ConfigurationError, match=r'robot\.urdf: not well-formed XML'):
        load(TEXT, '<robot>')


def test_relative_urdf_is_refused_for_a_node():
    with pytest.raises(
        ConfigurationError, match=r"robot\.urdf: 'r\.urdf' is relative, and a node does not know"
    ):
        resolve_urdf('r.urdf', beside=None)


def test_package_url_resolves_from_the_checkout_and_from_an_installation(tmp_path, monkeypatch):
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    url = 'package://spacerobot_ros/config/servicer.urdf'
    assert resolve_urdf(url, None) == SERVICER.with_suffix('.urdf')
    installed = tmp_path / 'share' / 'spacerobot_ros' / 'config' / 'servicer.urdf'
    installed.parent.mkdir(parents=True)
    installed.write_text('<robot/>')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert resolve_urdf(url, None) == installed
    assert resolve_urdf(f'file://{installed}', None) == installed


PLATE = np.diag([1.0, 1.0, 2.0])
BASE = Part('base_link', -1, 'base', 10.0, np.zeros(3), PLATE)
SINGULAR = [
    (
        'massless base',
        [
            replace(BASE, mass=0.0, inertia=0 * PLATE),
            Part('a', 0, 'continuous', 1.0, np.zeros(3), PLATE),
        ],
        'base_link',
    ),
    (
        'point base',
        [replace(BASE, inertia=0 * PLATE), Part('a', 0, 'continuous', 1.0, np.zeros(3), PLATE)],
        'base_link',
    ),
    ('massless leaf', [BASE, Part('a', 0, 'continuous', 0.0, np.zeros(3), 0 * PLATE)], 'a'),
    (
        'point on the axis',
        [BASE, Part('a', 0, 'continuous', 1.0, np.array([1.0, 0.0, 0.0]), 0 * PLATE)],
        'a',
    ),
    ('massless slide', [BASE, Part('a', 0, 'prismatic', 0.0, np.zeros(3), 0 * PLATE)], 'a'),
]


@pytest.mark.parametrize(
    ('parts', 'link'), [case[1:] for case in SINGULAR], ids=[case[0] for case in SINGULAR]
)
def test_trees_that_can_not_move_are_refused(parts, link):
    with pytest.raises(ConfigurationError, match=f"URDF: link '{link}': .* inertia"):
        robot_of(parts)


@pytest.mark.parametrize('kind', ['continuous', 'prismatic'])
def test_two_joints_of_one_motion_with_no_mass_between_are_refused_both_by_name(kind):
    nothing = Part('a', 0, kind, 0.0, np.zeros(3), 0 * PLATE)
    last = Part('b', 1, kind, 1.0, np.zeros(3), PLATE, origin=np.array([0.3, 0.0, 0.0]))
    with pytest.raises(ConfigurationError, match=r"link 'a': joints 'j_a' and 'j_b' .* hold one"):
        robot_of([BASE, nothing, last])
    for other in (
        replace(last, axis=np.array([0.0, 1.0, 0.0])),
        *([replace(last, origin=np.array([0.0, 0.3, 0.0]))] * (kind == 'continuous')),
    ):
        robot = robot_of([BASE, nothing, other])
        M = Dynamics(robot).mass_matrix(np.full(2, 0.3))
        size = np.sqrt(np.diag(M))
        assert np.linalg.eigvalsh(M / np.outer(size, size))[0] > 1e-3


def test_a_fixed_base_needs_no_mass():
    parts = [
        replace(BASE, mass=0.0, inertia=0 * PLATE),
        Part('a', 0, 'continuous', 1.0, np.zeros(3), PLATE),
    ]
    assert not robot_of(parts, base='fixed').is_free


def test_a_fixed_base_needs_no_inertia_of_a_body(tmp_path):
    """Its robot is read, shown and written, and moves as one whose root has nothing."""
    parts = [
        replace(BASE, inertia=np.diag([1.0, 1.0, 9.0])),
        Part('a', 0, 'continuous', 1.0, np.array([0.3, 0.0, 0.0]), PLATE),
    ]
    with pytest.raises(ConfigurationError, match='triangle inequality'):
        robot_of(parts)
    robot = robot_of(parts, base='fixed')
    empty = robot_of([replace(BASE, mass=0.0, inertia=0 * PLATE), parts[1]], base='fixed')
    assert robot.bodies[0].mass == 0.0
    np.testing.assert_array_equal(inverse_mass(robot), inverse_mass(empty))
    shapes, _ = shapes_of(robot, tmp_path)
    assert [len(own) for own in shapes] == [len(own) for own in shapes_of(empty, tmp_path)[0]]
    assert not parse_urdf(urdf_text(robot)).links['base_link'].mass


ROW = (480.0, 480.0, 0.0, 0.0, 400.0, 0.0, 900.0, 0.0, 0.0, 900.0)
TRUTH = [
    (
        TruthSettings(target_momentum=(1.0,)),
        r'truth.target_momentum: expected shape \(3,\), got \(1,\)',
    ),
    (
        TruthSettings(servicer_momentum=(1.0,)),
        r'truth.servicer_momentum: expected shape \(3,\), got \(1,\)',
    ),
    (TruthSettings(target_rates=(1.0,)), r'truth.target_rates: expected 0 \(one a rotor\), got 1'),
    (
        TruthSettings(links=('link_3',)),
        'truth.inertial_parameters: expected 10 a link in truth.links, got 0',
    ),
    (
        TruthSettings(inertial_parameters=ROW),
        'truth.inertial_parameters: expected 10 a link in truth.links, got 10',
    ),
    (
        TruthSettings(links=('hand',), inertial_parameters=ROW),
        r"truth.links\[0\]: no body 'hand' \(bodies: base_link, ",
    ),
    (
        TruthSettings(links=('link_3',) * 2, inertial_parameters=ROW * 2),
        r"truth.links\[1\]: 'link_3' is named twice",
    ),
    (
        TruthSettings(links=('link_3',), inertial_parameters=(0.0, *ROW[1:])),
        "of 'link_3': mass 0 kg must be above zero",
    ),
    (
        TruthSettings(links=('link_3',), inertial_parameters=(480.0, 4800.0, *ROW[2:])),
        "of 'link_3': inertia is not positive",
    ),
]


@pytest.mark.parametrize(('truth', 'match'), TRUTH)
def test_truth_refusals(truth, match):
    settings = settings_of(table_one(), target_wheels={'links': ['link_3']})
    with pytest.raises(ConfigurationError, match=match):
        true_robot(build_robot(settings, to_urdf(table_one())), replace(settings, truth=truth))


def test_truth_changes_only_what_it_names():
    settings = settings_of(table_one(), servicer_wheels={'momentum': [25.0, 27.0, 28.0]})
    robot = build_robot(settings, to_urdf(table_one()))
    assert true_robot(robot, settings) is robot
    plant = true_robot(
        robot, replace(settings, truth=TruthSettings(links=('link_3',), inertial_parameters=ROW))
    )
    np.testing.assert_array_equal(plant.inertial_parameters[:3], robot.inertial_parameters[:3])
    np.testing.assert_allclose(plant.inertial_parameters[3], ROW, rtol=1e-13, atol=1e-11)
    np.testing.assert_array_equal(plant.servicer_momentum, [25.0, 27.0, 28.0])


@pytest.mark.parametrize(
    ('initial', 'match'),
    [
        (
            InitialSettings(attitude_xyzw=(0.2, 0.1, 0.3, 0.93)),
            'must be a unit quaternion, its norm is 1.00',
        ),
        (
            InitialSettings(attitude_xyzw=(0.0, 0.0, 0.0, 0.0)),
            'must be a unit quaternion, its norm is 0',
        ),
        (
            InitialSettings(joint_position=(0.0,)),
            r'initial.joint_position: expected 3 numbers \(one a joint\), got 1',
        ),
        (
            InitialSettings(joint_velocity=(0.0,) * 4),
            r'initial.joint_velocity: expected 3 numbers .* got 4',
        ),
    ],
)
def test_initial_state_refusals(initial, match):
    with pytest.raises(ConfigurationError, match=match):
        initial_state(robot_of(table_one()), initial)


def test_a_fixed_base_does_not_turn():
    with pytest.raises(
        ConfigurationError, match=r'initial\.angular_velocity: must be zero for a fixed base'
    ):
        initial_state(
            robot_of(table_one(), base='fixed'), InitialSettings(angular_velocity=(0.1, 0.0, 0.0))
        )


def test_settings_take_what_ros_gives():
    # Array parameters arrive from rclpy as array.array or numpy arrays, names as lists.
    settings = parse_settings({'robot': {'joints': ['a'], 'gravity': np.array([0.0, 0.0, -9.81])}})
    assert settings.robot.gravity == (0.0, 0.0, -9.81)
