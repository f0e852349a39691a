"""Access policies of SROS 2 with the least that each node needs, read off the nodes themselves.

    python scripts/security_policy.py > config/security/policy.xml
    ros2 security generate_artifacts -k keystore -p config/security/policy.xml

Each node has an enclave of its name. Nodes are made with several settings, because some topics
depend on them.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.model.loader import package_folder
from spacerobot_ros.nodes.program import NODES, node_class
from spacerobot_ros.ros.session import Session

_ACTION = '/_action/'
_KINDS = (
    ('topics', 'publish', 'get_publisher_names_and_types_by_node'),
    ('topics', 'subscribe', 'get_subscriber_names_and_types_by_node'),
    ('services', 'reply', 'get_service_names_and_types_by_node'),
    ('services', 'request', 'get_client_names_and_types_by_node'),
)
_SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ('servicer', {'controller.save_parameters': ''}),
    ('minisat', {'controller.law': 'adaptive_rls', 'controller.save_file': '/tmp/none/learned'}),
)


def policy() -> str:
    """The policy of all nodes, as XML of sros2's schema 0.2.0."""
    used: dict[str, dict[tuple[str, str], set[str]]] = defaultdict(lambda: defaultdict(set))
    for robot, changes in _SETTINGS:
        file = load_robot_file(package_folder('spacerobot_ros') / 'config' / f'{robot}.yaml')
        for node in NODES:
            _note(node_class(node), file.settings.changed(changes), file.robot.urdf, used)
    for rules in used.values():
        rules['topics', 'publish'].add('rosout')
        if 'robot_description' not in rules['topics', 'publish']:
            rules['topics', 'subscribe'].add('robot_description')
    root = Element('policy', version='0.2.0')
    enclaves = SubElement(root, 'enclaves')
    for name, rules in sorted(used.items()):
        profiles = SubElement(SubElement(enclaves, 'enclave', path=f'/{name}'), 'profiles')
        profile = SubElement(profiles, 'profile', ns='/', node=name)
        for (group, right), names in sorted(rules.items()):
            part = SubElement(profile, group, {right: 'ALLOW'})
            for each in sorted(names):
                SubElement(part, group.removesuffix('s')).text = each
    indent(root)
    text = tostring(root, encoding='unicode')
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _note(kind: Callable[..., Any], settings: Any, urdf: str, used: Any) -> None:
    with Session() as session:
        node = session.add(kind, settings, urdf)
        for group, right, query in _KINDS:
            for name, _ in getattr(node, query)(node.get_name(), node.get_namespace()):
                if _ACTION in name:
                    action = name.partition(_ACTION)[0]
                    used[node.get_name()]['actions', 'execute'].add(_short(action, node))
                else:
                    used[node.get_name()][group, right].add(_short(name, node))


def _short(name: str, node: Any) -> str:
    own = f'/{node.get_name()}/'
    return f'~/{name[len(own) :]}' if name.startswith(own) else name.removeprefix('/')


if __name__ == '__main__':
    sys.stdout.write(policy())
