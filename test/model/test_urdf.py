"""URDF in, checked tree out; every refusal names its place."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spacerobot_ros.errors import ModelError
from spacerobot_ros.model.rigid_body import check_inertia
from spacerobot_ros.model.urdf import parse_urdf

GOOD = """<robot name="r">
  <link name="base_link"><inertial><origin xyz="0 0 0.5" rpy="0 0 0"/><mass value="10"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1.5" iyz="0" izz="2"/></inertial></link>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.2"/></inertial></link>
  <joint name="j1" type="revolute"><parent link="base_link"/><child link="arm"/>
    <origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit effort="5" lower="-1" upper="2"/></joint>
</robot>"""
EXTRA = '<link name="tip"/><joint name="j2" type="fixed">'
EXTRA += '<parent link="{parent}"/><child link="{child}"/></joint></robot>'


def _with(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


REFUSALS = [
    *(
        (
            f'{key} {text}',
            _with('<limit effort', f'<dynamics {key}="{text}"/><limit effort'),
            f"joint 'j1' dynamics {key}: '{text}' is no friction: write a finite number from 0 on",
        )
        for key in ('damping', 'friction')
        for text in ('-1', 'nan', 'inf', 'some')
    ),
    ('not XML', GOOD[:-3], 'r.urdf: not well-formed XML'),
    ('empty', '', 'r.urdf: not well-formed XML'),
    ('another document', '<sdf/>', 'r.urdf: the root element is <sdf>, expected <robot>'),
    (
        'no links',
        '<robot name="r"/>',
        'r.urdf: must be one tree, but its links without a parent are: none',
    ),
    (
        'NaN mass',
        _with('mass value="1"', 'mass value="nan"'),
        r"link 'arm' mass: expected 1 finite number\(s\), got 'nan'",
    ),
    (
        'huge mass',
        _with('mass value="1"', 'mass value="1e51"'),
        r"link 'arm' mass: expected 1 finite number\(s\), got '1e51'; magnitudes end at 1e\+50",
    ),
    (
        'mass with an underscore',
        _with('mass value="1"', 'mass value="1_0"'),
        r"link 'arm' mass: expected 1 number\(s\), got '1_0'",
    ),
    (
        'mass in other digits',
        _with('mass value="1"', 'mass value="\u0661"'),
        r"link 'arm' mass: expected 1 number\(s\), got '\u0661'",
    ),
    (
        'infinite inertia',
        _with('izz="2"', 'izz="inf"'),
        "link 'base_link' inertia izz: expected 1 finite",
    ),
    (
        'not a number',
        _with('mass value="1"', 'mass value="one"'),
        r"link 'arm' mass: expected 1 number\(s\), got 'one'",
    ),
    (
        'negative mass',
        _with('mass value="1"', 'mass value="-1"'),
        "link 'arm': negative mass -1 kg",
    ),
    (
        'inertia without mass',
        _with('mass value="1"', 'mass value="0"'),
        "link 'arm': has inertia but no mass",
    ),
    ('no mass', _with('<mass value="1"/>', ''), "link 'arm': <inertial> needs both"),
    (
        'triangle',
        _with('izz="0.2"', 'izz="0.21"'),
        r"link 'arm': no rigid body .* 0.21 > 0.1 \+ 0.1",
    ),
    ('indefinite', _with('ixx="0.1"', 'ixx="-0.1"'), "link 'arm': inertia is not positive"),
    (
        'asymmetric',
        _with('izz="2"', 'izz="2" iyx="0.1"'),
        "link 'base_link' inertia: asymmetric: iyx = 0.1 but ixy = 0.0",
    ),
    (
        'unknown moment',
        _with('izz="2"', 'izz="2" iww="0.1"'),
        "link 'base_link' inertia: unknown attribute 'iww'",
    ),
    (
        'short attribute',
        _with('izz="2"', 'izz="2" i="1"'),
        "link 'base_link' inertia: unknown attribute 'i'",
    ),
    ('missing moment', _with(' izz="2"', ''), "link 'base_link' inertia: missing izz"),
    (
        'origin of two',
        _with('xyz="0 0 0.5"', 'xyz="0 0.5"'),
        r"link 'base_link' origin xyz: expected 3 finite number\(s\)",
    ),
    (
        'NaN origin',
        _with('xyz="0 0 1" rpy', 'xyz="0 nan 1" rpy'),
        "joint 'j1' origin xyz: expected 3 finite",
    ),
    (
        'NaN rpy',
        _with('xyz="0 0 1" rpy="0 0 0"', 'rpy="0 nan 0"'),
        "joint 'j1' origin rpy: expected 3 finite",
    ),
    (
        'axis not unit',
        _with('<axis xyz="0 0 1"', '<axis xyz="0 1 1"'),
        "joint 'j1' axis: must be a unit vector, its length is 1.41421",
    ),
    (
        'axis zero',
        _with('<axis xyz="0 0 1"', '<axis xyz="0 0 0"'),
        "joint 'j1' axis: must be a unit vector",
    ),
    (
        'axis of four',
        _with('<axis xyz="0 0 1"', '<axis xyz="0 0 1 0"'),
        "joint 'j1' axis: expected 3 finite",
    ),
    (
        'joint type',
        _with('type="revolute"', 'type="floating"'),
        "joint 'j1': joint type 'floating' is not supported",
    ),
    (
        'mimic',
        _with('<axis', '<mimic/><axis'),
        "joint 'j1' mimic: names no joint",
    ),
    (
        'no parent',
        _with('<parent link="base_link"/>', ''),
        "joint 'j1': needs <parent> and <child>",
    ),
    (
        'unknown child',
        _with('<child link="arm"', '<child link="arn"'),
        "joint 'j1': names the link 'arn', which does not exist",
    ),
    ('limits crossed', _with('upper="2"', 'upper="-2"'), "joint 'j1': limits make no sense"),
    (
        'negative effort',
        _with('effort="5"', 'effort="-5"'),
        "joint 'j1': limits make no sense: effort -5",
    ),
    (
        'negative velocity',
        _with('effort="5"', 'velocity="-5"'),
        "joint 'j1': limits make no sense: effort inf, velocity -5",
    ),
    (
        'NaN limit',
        _with('effort="5"', 'effort="nan"'),
        "joint 'j1' effort limit: expected 1 finite",
    ),
    ('nameless link', _with('<link name="arm">', '<link>'), '<link>: has no name'),
    ('nameless joint', _with('name="j1"', ''), '<joint>: has no name'),
    (
        'link twice',
        _with('</robot>', '<link name="arm"/></robot>'),
        "link 'arm': this name is used twice",
    ),
    (
        'joint twice',
        _with('</robot>', EXTRA.format(parent='arm', child='tip').replace('j2', 'j1')),
        "joint 'j1': this name is used twice",
    ),
    (
        'closed loop',
        _with('</robot>', EXTRA.format(parent='tip', child='arm')),
        "link 'arm': has two parents .*'j1' and 'j2'",
    ),
    (
        'two roots',
        _with('</robot>', '<link name="loose"/></robot>'),
        'must be one tree, .* base_link, loose',
    ),
    (
        'detached loop',
        _with(
            '</robot>',
            '<link name="a"/>'
            + EXTRA.format(parent='a', child='tip').replace('</robot>', '')
            + '<joint name="j3" type="fixed"><parent link="tip"/>'
            '<child link="a"/></joint></robot>',
        ),
        'links form a loop: a, tip',
    ),
]


@pytest.mark.parametrize(
    ('urdf', 'match'), [case[1:] for case in REFUSALS], ids=[case[0] for case in REFUSALS]
)
def test_refusals_name_their_place(urdf, match):
    with pytest.raises(ModelError, match=match) as caught:
        parse_urdf(urdf, 'r.urdf')
    assert str(caught.value).startswith('r.urdf: ')
    assert '\n' not in str(caught.value)


def test_good_urdf():
    tree = parse_urdf(GOOD)
    assert tree.root == 'base_link'
    assert tree.joints['j1'].position_limit == (-1.0, 2.0)
    assert tree.joints['j1'].effort_limit == 5.0
    np.testing.assert_array_equal(tree.links['base_link'].com, [0.0, 0.0, 0.5])
    np.testing.assert_array_equal(tree.links['base_link'].inertia, np.diag([1.0, 1.5, 2.0]))


def test_continuous_joint_has_no_range_and_absent_limits_are_infinite():
    tree = parse_urdf(_with('type="revolute"', 'type="continuous"'))
    assert tree.joints['j1'].position_limit == (-np.inf, np.inf)
    tree = parse_urdf(_with('<limit effort="5" lower="-1" upper="2"/>', ''))
    assert tree.joints['j1'].effort_limit == tree.joints['j1'].velocity_limit == np.inf
    fast = parse_urdf(_with('effort="5"', 'effort="5" velocity="0.7"'))
    assert fast.joints['j1'].velocity_limit == 0.7


def test_half_a_range_ends_at_zero_as_urdf_has_it():
    assert parse_urdf(_with(' upper="2"', '')).joints['j1'].position_limit == (-1.0, 0.0)
    assert parse_urdf(_with(' lower="-1"', '')).joints['j1'].position_limit == (0.0, 2.0)


def test_inertial_frame_is_turned_into_the_link_frame():
    # A quarter turn about x puts the tensor's y on the link's z.
    tree = parse_urdf(
        _with('xyz="0 0 0.5" rpy="0 0 0"', 'xyz="0 0 0.5" rpy="1.5707963267948966 0 0"')
    )
    np.testing.assert_allclose(
        tree.links['base_link'].inertia, np.diag([1.0, 2.0, 1.5]), rtol=0, atol=1e-15
    )


WELDED = (
    '<link name="antenna"><inertial><mass value="{mass}"/><inertia ixx="-3.5e-8" ixy="0" ixz="0" '
    'iyy="3.5e-8" iyz="0" izz="9.1e-8"/></inertial></link><joint name="j2" type="{kind}">'
    '<parent link="arm"/><child link="antenna"/></joint></robot>'
)


def test_a_body_is_what_its_welded_links_make():
    """Of a TIAGo's two antennas moments are negative, beside the 40 kg that they stand on."""
    links = parse_urdf(_with('</robot>', WELDED.format(mass=0.5, kind='fixed'))).links
    assert links['antenna'].mass == 0.0
    assert links['arm'].mass == 1.5
    own = np.diag([-3.5e-8, 3.5e-8, 9.1e-8])  # both at the arm's origin
    np.testing.assert_allclose(links['arm'].inertia, np.diag([0.1, 0.1, 0.2]) + own, atol=1e-15)
    for kind in ('continuous', 'prismatic'):
        with pytest.raises(ModelError, match="link 'antenna': inertia is not positive"):
            parse_urdf(_with('</robot>', WELDED.format(mass=1e-6, kind=kind)))
    heavy = WELDED.format(mass=1e-6, kind='fixed').replace('-3.5e-8', '-0.35')
    with pytest.raises(ModelError, match="link 'antenna': inertia is not positive"):
        parse_urdf(_with('</robot>', heavy))


def test_a_chain_of_welded_links_is_longer_than_the_stack():
    count, welded = 2000, ''
    for k in range(count):
        parent = f'w{k - 1}' if k else 'arm'
        welded += f'<link name="w{k}"/>' + EXTRA.removeprefix('<link name="tip"/>').format(
            parent=parent, child=f'w{k}'
        ).removesuffix('</robot>').replace('"j2"', f'"f{k}"')
    mass = '<inertial><mass value="0.5"/><inertia ixx="-1e-9" iyy="0" izz="0"/></inertial>'
    last = f'<link name="w{count - 1}">{mass}</link>'.replace('iyy', 'ixy="0" ixz="0" iyz="0" iyy')
    text = _with('</robot>', welded.replace(f'<link name="w{count - 1}"/>', last) + '</robot>')
    assert parse_urdf(text).links['arm'].mass == 1.5


ROOTS = {
    'triangle': ('1', 'ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="9"', 'triangle inequality'),
    'negative': ('1', 'ixx="-1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"', 'not positive'),
    'massless': ('0', 'ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"', 'inertia but no mass'),
}
"""As of an iCub's root, or of a KINOVA's with a digit too many."""


@pytest.mark.parametrize(('mass', 'inertia', 'why'), ROOTS.values(), ids=ROOTS)
@pytest.mark.parametrize('is_welded', [False, True])
def test_what_stands_on_the_ground_needs_no_inertia(mass, inertia, why, is_welded):
    body = f'<inertial><mass value="{mass}"/><inertia {inertia}/></inertial>'
    arm = '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    ends = '<parent link="{}"/><child link="{}"/>'.format
    text = (
        f'<robot name="x"><link name="foot">{"" if is_welded else body}</link>'
        f'<link name="plate">{body if is_welded else ""}</link>'
        f'<link name="arm"><inertial>{arm}</inertial></link>'
        f'<joint name="weld" type="fixed">{ends("foot", "plate")}</joint>'
        f'<joint name="j1" type="continuous">{ends("plate", "arm")}</joint></robot>'
    )
    links = parse_urdf(text, is_on_ground=True).links
    assert links['foot'].mass == links['plate'].mass == 0.0
    assert not np.any(links['foot'].inertia)
    assert not np.any(links['plate'].inertia)
    assert links['arm'].mass == 1.0
    with pytest.raises(ModelError, match=why):
        parse_urdf(text)  # it floats
    other = text.replace(body, '').replace(f'<inertial>{arm}</inertial>', body)
    with pytest.raises(ModelError, match=f"link 'arm': .*{why}"):
        parse_urdf(other, is_on_ground=True)  # it moves
    with pytest.raises(ModelError, match='negative mass'):
        parse_urdf(
            text.replace(f'"{mass}"/><inertia {inertia}', f'"-1"/><inertia {inertia}'),
            is_on_ground=True,
        )


def test_a_dummy_root_has_what_is_welded_to_it():
    """As of an ANYmal: `base` is a name alone, its sensor a rod, its trunk a third link."""
    rod = 'ixx="1e-6" ixy="1e-6" ixz="1e-6" iyy="1e-6" iyz="1e-6" izz="1e-6"'
    round_ = 'ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.3"'
    parts = {'sensor': (0.001, rod), 'trunk': (16.0, round_), 'foot': (0.0, round_)}
    links = ''.join(
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial>'
        '</link>'
        f'<joint name="to_{name}" type="fixed"><parent link="base"/><child link="{name}"/></joint>'
        for name, (mass, inertia) in parts.items()
    )
    tree = parse_urdf(f'<robot name="x"><link name="base"/>{links}</robot>')
    assert tree.links['base'].mass == 16.001
    expected = 0.6 * np.eye(3) + 1e-6  # all at one origin, the rod's six numbers being one
    np.testing.assert_allclose(tree.links['base'].inertia, expected, atol=1e-15)
    assert not any(tree.links[name].mass for name in parts)


def test_redundant_but_symmetric_products_are_read():
    tree = parse_urdf(_with('ixy="0" ixz="0" iyy="1.5"', 'ixy="0.1" iyx="0.1" ixz="0" iyy="1.5"'))
    assert tree.links['base_link'].inertia[1, 0] == 0.1


@pytest.mark.parametrize(
    ('mass', 'inertia', 'match'),
    [
        (np.nan, np.eye(3), 'not finite'),
        (1.0, np.diag([1.0, 1.0, np.inf]), 'not finite'),
        (1.0, np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), 'not symmetric'),
    ],
)
def test_check_inertia(mass, inertia, match):
    with pytest.raises(ModelError, match=match):
        check_inertia(mass, inertia, 'here')


def test_a_flat_plate_and_a_point_mass_are_physical():
    check_inertia(1.0, np.diag([1.0, 2.0, 3.0]), 'plate')
    check_inertia(1.0, np.zeros((3, 3)), 'point')


@pytest.mark.parametrize('rpy', ['0 0 0', '0.4 -1.1 2.0'])
def test_an_inertia_that_no_body_has_is_refused_beside_the_nearest_one(rpy):
    """As CAD programs round: what the message says is taken where the inertia stands in the file,
    and is off by a third of the lack.
    """
    inertia = 'ixx="0.00777" ixy="1e-4" ixz="0" iyy="0.00156" iyz="2e-5" izz="0.00598"'
    origin = f'<origin rpy="{rpy}"/><mass value="1"/>'
    body = (
        f'<robot name="r"><link name="a"><inertial>{origin}<inertia %s/></inertial></link></robot>'
    )
    with pytest.raises(ModelError) as refused:
        parse_urdf(body % inertia)
    near = str(refused.value).partition('in its own axes: ')[2]
    (mended,) = parse_urdf(body % near).links.values()
    turned = Rotation.from_euler('xyz', [float(angle) for angle in rpy.split()]).as_matrix()
    given = np.array([[777e-5, 1e-4, 0], [1e-4, 156e-5, 2e-5], [0, 2e-5, 598e-5]])
    assert 0.0 < np.linalg.norm(mended.inertia - turned @ given @ turned.T) < 1.5e-4


def test_all_that_is_wrong_is_said_at_once():
    text = _with('mass value="1"', 'mass value="one"').replace(
        'axis xyz="0 0 1"', 'axis xyz="0 1 1"'
    )
    with pytest.raises(
        ModelError, match=r"^r.urdf: 2 faults: link 'arm' mass: .*; joint 'j1' axis"
    ):
        parse_urdf(text, 'r.urdf')
    text = _with('mass value="10"', 'mass value="-10"').replace(
        'mass value="1"', 'mass value="-1"'
    )
    with pytest.raises(ModelError, match=r"2 faults: link 'base_link': neg.*; link 'arm': neg"):
        parse_urdf(text, 'r.urdf')


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('<robot name', '<robot xmlns="http://example.org/robot" name'),
        ('<link name="arm">', '<!-- arm -- of two -- parts --><link name="arm">'),
        (
            '<link name="arm">',
            '<xacro:sensors xmlns:xacro="http://ros.org/wiki/xacro" api="x"/><link name="arm">',
        ),
        ('effort="5"', 'effort="1.7976931348623157e+308" velocity="inf"'),
    ],
    ids=['name space', 'dashes in a comment', 'left over by xacro', 'no limit'],
)
def test_what_every_reader_takes_is_taken(old, new):
    tree, plain = parse_urdf(_with(old, new)), parse_urdf(GOOD)
    assert list(tree.links) == list(plain.links)
    assert tree.joints['j1'].effort_limit == (np.inf if 'inf' in new else 5.0)


def test_limits_that_mean_none():
    largest = 'lower="-1.7976931348623157e+308" upper="inf"'
    assert parse_urdf(_with('lower="-1" upper="2"', largest)).joints['j1'].position_limit == (
        -np.inf,
        np.inf,
    )


def test_an_inertia_that_is_zero_but_for_rounding_is_zero():
    text = _with(
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.2"/>',
        '<inertia ixx="-1e-18" ixy="0" ixz="3e-17" iyy="1e-20" iyz="0" izz="0"/>',
    )
    assert not parse_urdf(text).links['arm'].inertia.any()
