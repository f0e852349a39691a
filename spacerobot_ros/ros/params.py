"""ROS parameters of a node, from the one schema in `model.settings`.

All that a parameter file or `-p` sets is validated as a whole, unknown names included; then every
parameter of the schema is declared with its meaning, unit and bounds, so that `ros2 param list`
and `ros2 param describe` teach what there is. Few of them may change while a node runs; a node
that is asked to change another says why it does not.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from ..errors import ConfigurationError
from ..model.files import read_text
from ..model.loader import build_robot, resolve_urdf
from ..model.robot import Robot
from ..model.schema import Allowed, FloatList, TextList, meanings, plain_types
from ..model.settings import Settings, parse_settings
from .qos import LATCHED
from .scheduling import SCHEDULING

OWN: dict[str, tuple[Any, str, tuple[str, ...]]] = {
    'robot_description': ('', 'URDF text; takes the place of robot.urdf.', ()),
    'autostart': (True, 'Configure and activate without a lifecycle manager.', ()),
    'scheduling': (
        'none',
        'Share of the processor: nice (behind all others) or fifo (real time, where permitted).',
        tuple(SCHEDULING),
    ),
}
"""Parameters of the nodes that are not part of a robot file: default, meaning and choices."""

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
    own = {name: given.pop(name, default) for name, (default, *_) in OWN.items()}
    settings = parse_settings({'robot': {}, **nested(given)})
    for name, (default, doc, choices) in OWN.items():
        value, limits = own[name], _choices(choices)
        if type(value) is not type(default) or (choices and value not in choices):
            expected = limits or type(default).__name__
            raise ConfigurationError(name, f'expected {expected}, got {value!r}')
        node.declare_parameter(name, value, _descriptor(doc, limits=limits), ignore_override=True)
    for leaf in leaves(settings):
        _declare(node, leaf)
    for name, value, meaning in _free_entries(settings):
        node.declare_parameter(name, value, _descriptor(meaning), ignore_override=True)
    return settings


def _free_entries(settings: Settings) -> Iterator[tuple[str, Any, str]]:
    """Dotted name, value and meaning of what stands under free names."""
    for section, entries, meaning in (
        ('effects', settings.effects, 'Of a physical effect that the model believes in.'),
        (
            'robot.uncertainty.links',
            settings.robot.uncertainty.links,
            'As robot.uncertainty of the same name, of one link.',
        ),
    ):
        for name, value in _flat(section, entries):
            yield name, value, meaning


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Values of a nested map under dotted names."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _flat(f'{name}.{key}', entry)
    else:
        yield name, list(value) if isinstance(value, tuple) else value


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
    known = {leaf.name for leaf in leaves(settings())} | set(OWN)
    known |= {name for name, *_ in _free_entries(settings())}

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
    values = {leaf.name: leaf.value for leaf in leaves(settings)} | dict(asked)
    plain = {
        name: list(value) if hasattr(value, '__len__') and not isinstance(value, str) else value
        for name, value in values.items()
    }
    parsed = parse_settings(nested({k: v for k, v in plain.items() if v not in (None, [])}))
    sections = {name.partition('.')[0] for name in asked}
    return replace(settings, **{name: getattr(parsed, name) for name in sections})


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names to a nested mapping.

    Raises:
        ConfigurationError: a name that is both a value and a section.
    """
    tree: dict[str, Any] = {}
    for name, value in sorted(flat.items()):
        *sections, leaf = name.split('.')
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
            if not isinstance(branch, dict):
                raise ConfigurationError(
                    name, f'{section!r} is a value, it has no parameters below'
                )
        if isinstance(branch.get(leaf), dict):
            raise ConfigurationError(name, 'is a section, it takes no value')
        branch[leaf] = value
    return tree


class Leaf(NamedTuple):
    """A parameter: dotted name, meaning, what it may be, type and value."""

    name: str
    meaning: str
    allowed: Allowed
    kind: Any
    value: Any


def leaves(section: Any, prefix: str = '') -> Iterator[Leaf]:
    """Every parameter below a section."""
    hints, meaning = typing.get_type_hints(type(section)), meanings(type(section))
    for f in fields(section):
        value = getattr(section, f.name)
        if is_dataclass(value):
            yield from leaves(value, f'{prefix}{f.name}.')
        elif f.metadata:  # no entries under free names
            kind, *_ = plain_types(hints[f.name])
            yield Leaf(prefix + f.name, meaning[f.name], f.metadata['allowed'], kind, value)


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
    length = '' if allowed.length is None else f'{allowed.length} numbers'
    limits = '; '.join(filter(None, [_choices(allowed.choices), length, *allowed.words]))
    descriptor = _descriptor(leaf.meaning, allowed.unit, limits)
    descriptor.dynamic_typing = value is None
    given: Any = list(value) if isinstance(value, tuple) else value
    if given == []:  # alone it would be declared as one of bytes
        given = _LISTS[leaf.kind]
    node.declare_parameter(leaf.name, given, descriptor, ignore_override=True)
    if value == ():
        node.set_parameters([Parameter(leaf.name, given, [])])


_LISTS = {FloatList: Parameter.Type.DOUBLE_ARRAY, TextList: Parameter.Type.STRING_ARRAY}


def _choices(choices: Collection[str] | None) -> str:
    return f'one of {", ".join(choices)}' if choices else ''


def _descriptor(doc: str, unit: str = '', limits: str = '') -> ParameterDescriptor:
    description = f'{doc} [{unit}]' if unit else doc
    return ParameterDescriptor(description=description, additional_constraints=limits)
