"""ROS parameters of a node, from the one schema in `model.settings`.

All that a parameter file or `-p` sets is validated as a whole, unknown names included; then every
parameter of the schema is declared with its meaning, unit and bounds, so that `ros2 param list`
and `ros2 param describe` teach what there is. Few of them may change while a node runs; a node
that is asked to change another says why it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from ..errors import ConfigurationError
from ..model.files import read_text
from ..model.loader import build_robot, resolve_urdf
from ..model.robot import Robot
from ..model.schema import Leaf, TextList, leaves, param, parse_section
from ..model.settings import Settings, parse_settings
from .qos import LATCHED
from .scheduling import SCHEDULING


@dataclass(frozen=True, kw_only=True)
class NodeSettings:
    """Parameters of the nodes that are not part of a robot file.

    Args:
        robot_description: URDF text; takes the place of robot.urdf.
        autostart: Configure and activate without a lifecycle manager.
        scheduling: Share of the processor: nice (behind all others) or fifo (real time, where
            permitted).
    """

    robot_description: str = param('')
    autostart: bool = param(True)
    scheduling: str = param('none', choices=tuple(SCHEDULING))


_FIXED = (
    'is read when the node starts, for what it computes rests on it: start it again with '
    'another value'
)
_NULLS = ('null', '~')  # what rcl makes of a null, such as `ros2 param dump` writes for no value
_OF_ROS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.', '/')


def declare_settings(node: Node) -> Settings:
    """Validate the parameters given to a node, and declare all there are.

    Args:
        node: A node that has declared what it was given, and nothing else.

    Raises:
        ConfigurationError: an unknown parameter, or a value that the schema refuses.
    """
    given: dict[str, Any] = {}
    for name, parameter in node.get_parameters_by_prefix('').items():
        if not name.startswith(_OF_ROS):
            node.undeclare_parameter(name)  # declared anew, with its meaning
            if parameter.value not in _NULLS:
                given[name] = [] if parameter.value is None else parameter.value
    names = [f.name for f in fields(NodeSettings) if f.name in given]
    own = list(leaves(NodeSettings(**{name: given.pop(name) for name in names})))
    settings = parse_settings({'robot': {}, **nested(given)})
    for name, _, allowed, kind, value in own:
        if type(value) is not kind or value not in (allowed.choices or [value]):
            expected = '; '.join(allowed.limits) or kind.__name__
            raise ConfigurationError(name, f'expected {expected}, got {value!r}')
    for leaf in (*own, *leaves(settings)):
        _declare(node, leaf)
    return settings


def let_change(
    node: Node,
    settings: Callable[[], Settings],
    live: Collection[str],
    take: Callable[[Settings], None],
) -> None:
    """Answer who sets parameters of a node: all of a request are taken up, or none.

    Args:
        node: A node with `declare_settings` done.
        settings: Gives its present settings.
        live: Names of those that may change.
        take: Takes up other settings; raises ConfigurationError where they can't be.
    """
    known = {leaf.name for leaf in (*leaves(NodeSettings()), *leaves(settings()))}

    def answer(parameters: list[Parameter]) -> SetParametersResult:
        asked = {p.name: p.value for p in parameters if p.name in known}
        for name in asked:
            if name not in live:
                return SetParametersResult(successful=False, reason=f'{name}: {_FIXED}')
        try:
            if asked:
                take(_with(settings(), asked))
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(answer)


def _with(settings: Settings, asked: Mapping[str, Any]) -> Settings:
    """Settings in which some parameters have other values, checked as those of a file are."""
    changed = {}
    for name, value in asked.items():
        section, _, key = name.partition('.')
        parsed = parse_section(type(getattr(settings, section)), {key: value}, section)
        changed[name] = getattr(parsed, key)
    return settings.changed(changed)


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names to a nested mapping.

    Raises:
        ConfigurationError: a name below one that is a value.
    """
    tree: dict[str, Any] = {}
    for name, value in sorted(flat.items()):
        *sections, leaf = name.split('.')
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
            if not isinstance(branch, dict):
                why = f'{section!r} is a value, it has no parameters below'
                raise ConfigurationError(name, why)
        branch[leaf] = value
    return tree


def open_robot(node: Node, settings: Settings, use: Callable[[Robot], None]) -> None:
    """Build the robot and hand it on: now, or when /robot_description says what it is.

    From `robot_description`, otherwise `robot.urdf`, otherwise the latched topic.

    Args:
        node: Node with `declare_settings` done.
        settings: Its settings.
        use: Called once with the robot.

    Raises:
        ConfigurationError: anything wrong in URDF or settings.
    """
    description = node.get_parameter('robot_description').value
    if description:
        use(build_robot(settings, description, 'robot_description'))
    elif settings.robot.urdf:
        path = resolve_urdf(settings.robot.urdf, beside=None)
        use(build_robot(settings, read_text(path, 'robot.urdf'), str(path)))
    else:
        node.get_logger().info('no robot.urdf: waiting for /robot_description')
        seen: list[Robot] = []

        def take(message: String) -> None:
            if not seen:
                seen.append(build_robot(settings, message.data, '/robot_description'))
                use(seen[0])
            elif message.data != seen[0].urdf:
                node.get_logger().warning('/robot_description has changed: start again to use it')

        node.create_subscription(String, '/robot_description', take, LATCHED)


def _declare(node: Node, leaf: Leaf) -> None:
    """Declare a parameter, with a value whatever it is.

    Whoever asks for one that is typed but has none gets nothing, nor the others that he asks for.
    """
    value, allowed = leaf.value, leaf.allowed
    descriptor = ParameterDescriptor(
        description=f'{leaf.meaning} [{allowed.unit}]' if allowed.unit else leaf.meaning,
        additional_constraints='; '.join(allowed.limits),
        dynamic_typing=value is None,
    )
    given: Any = list(value) if isinstance(value, tuple) else value
    if given == []:  # alone it would be declared as one of bytes
        is_text = leaf.kind == TextList
        given = Parameter.Type.STRING_ARRAY if is_text else Parameter.Type.DOUBLE_ARRAY
    node.declare_parameter(leaf.name, given, descriptor, ignore_override=True)
    if value == ():
        node.set_parameters([Parameter(leaf.name, given, [])])
