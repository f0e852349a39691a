"""Views and policies name topics, fields and services that there are."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from geometry_msgs.msg import Vector3Stamped
from rosidl_parser.definition import AbstractNestedType, NamespacedType
from security_policy import policy
from sensor_msgs.msg import Imu
from spacerobot_msgs.msg import Tracking

from spacerobot_ros.ros.convert import message_type

pytestmark = pytest.mark.ros

CONFIG = Path(__file__).parents[2] / 'config'
TOPICS = {'/momentum': Vector3Stamped, '/tracking': Tracking, '/imu/data': Imu}
OF_ROS_PROPER = {'tf', '~/follow_joint_trajectory'}  # messages that the wheels do not have


def check(path, separator):
    topic = next(t for t in TOPICS if path.startswith(t + separator))
    kind = TOPICS[topic]
    for field in path[len(topic) + 1 :].split(separator):
        name = re.sub(r'\[\d+\]$', '', field)
        slots = dict(zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True))
        assert name in slots, path
        slot = slots[name]
        assert isinstance(slot, AbstractNestedType) == (name != field), path
        if isinstance(slot, NamespacedType):
            kind = message_type('/'.join([*slot.namespaces, slot.name]))


def test_the_layout_of_foxglove():
    layout = json.loads((CONFIG / 'views' / 'foxglove.json').read_text())
    panels = layout['configById']
    paths = [p['value'] for panel in panels.values() for p in panel.get('paths', ())]
    assert len(paths) == 12
    for path in paths:
        check(path, '.')
    shown = re.findall(r'"(\w+!\d)"', json.dumps(layout['layout']))
    assert sorted(shown) == sorted(panels)


def test_the_layout_of_plotjuggler():
    root = ElementTree.parse(CONFIG / 'views' / 'plotjuggler.xml').getroot()
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert len(curves) == 12
    for curve in curves:
        check(curve, '/')
    subscribed = next(root.iter('selected_topics')).get('value').split(';')
    assert sorted(subscribed) == sorted(TOPICS)


def test_the_view_of_rviz():
    view = yaml.safe_load((CONFIG / 'views' / 'spacerobot.rviz').read_text())[
        'Visualization Manager'
    ]
    assert view['Global Options']['Fixed Frame'] == 'inertial'
    robot = next(d for d in view['Displays'] if d['Name'] == 'Robot')
    assert robot['Description Topic']['Value'] == '/robot_description'


def rules(text):
    return {
        (enclave.get('path'), group.tag, *group.attrib.items(), item.text)
        for enclave in ElementTree.fromstring(text).iter('enclave')
        for group in enclave.iter()
        if group.tag in ('topics', 'services', 'actions')
        for item in group
    }


def test_the_policy_gives_each_node_what_it_uses_and_nothing_more():
    kept, needed = rules((CONFIG / 'security' / 'policy.xml').read_text()), rules(policy())
    assert not needed - kept
    assert {rule[-1] for rule in kept - needed} <= OF_ROS_PROPER
    of = {rule[0] for rule in kept}
    assert of == {'/simulator', '/identifier', '/controller', '/monitor'}
    torque = {rule[0] for rule in kept if rule[-1] == 'joint_commands' and 'publish' in rule[2]}
    assert torque == {'/controller'}
