"""URDF text to checked links and joints, before any dynamics library sees them.

Only what a rigid tree needs is read: links with inertials, joints with origin, axis and limits.
Everything unphysical or unsupported is refused here with the link or joint named, because dynamics
libraries accept most of it in silence.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..errors import ModelError
from ..types import Matrix3, Vector3
from .files import MOST_URDF
from .rigid_body import Solid, fault_of
from .schema import LARGEST
from .urdf_joints import MOVING, Joint, Mimic, with_held

INERTIA = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
Named = TypeVar('Named')
_NOTHING = Solid(0.0, np.zeros(3), np.zeros((3, 3)))
_XACRO = 'ros.org/wiki/xacro}'  # namespace of its elements, as the parser writes it


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A checked tree of links; `joints` in URDF order, `root` the only link without a parent."""

    name: str
    root: str
    links: dict[str, Solid]
    joints: dict[str, Joint]


def parse_urdf(
    text: str,
    place: str = 'URDF',
    *,
    is_on_ground: bool = False,
    held: Mapping[str, float] | None = None,
) -> Tree:
    """Parse and check a URDF.

    Args:
        text: The XML.
        place: What to call it in error messages.
        is_on_ground: Whether the root does not move, so that its inertia plays no part: one that
            no rigid body has is left out.
        held: Positions of joints that are held, which are fixed ones of the tree, as are those
            that mimic them.

    Returns:
        The checked tree.

    Raises:
        ModelError: malformed XML or numbers, unphysical inertia, unsupported joint, or not one
            tree.
    """
    if len(text) > MOST_URDF:
        raise ModelError(place, f'is larger than {MOST_URDF / 1e6:g} MB, the most that is read')
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ModelError(place, f'not well-formed XML: {error}') from error
    if any(_is_xacro(element) for element in root.iter()):
        why = 'is xacro, not URDF: convert it with `xacro FILE > robot.urdf` and name that'
        raise ModelError(place, why)
    if root.tag != 'robot':
        raise ModelError(place, f'the root element is <{root.tag}>, expected <robot>')
    links = _unique((_parse_link(e, place) for e in root.findall('link')), 'link', place)
    each = (_parse_joint(e, place) for e in root.findall('joint'))
    joints = _unique(((joint.name, joint) for joint in each), 'joint', place)
    joints = with_held(joints, held or {})
    children = {joint.child for joint in joints.values()}
    base = next((name for name in links if name not in children), '')
    for where, why in _faults_of_tree(links, joints, base, place):
        raise ModelError(where, why)
    checked = _checked(links, joints, place, base if is_on_ground else '')
    return Tree(root.get('name', 'robot'), base, checked, joints)


def by_parent(joints: dict[str, Joint]) -> dict[str, list[Joint]]:
    """The joints below each link that has some, in URDF order."""
    below: dict[str, list[Joint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    return below


def _unique(items: Iterable[tuple[str, Named]], kind: str, place: str) -> dict[str, Named]:
    named: dict[str, Named] = {}
    for name, item in items:
        if name in named:
            raise ModelError(f'{place}: {kind} {name!r}', 'this name is used twice')
        named[name] = item
    return named


def _parse_link(element: ElementTree.Element, place: str) -> tuple[str, Solid]:
    name = element.get('name', '')
    where = f'{place}: link {name!r}'
    if not name:
        raise ModelError(f'{place}: <link>', 'has no name')
    inertial = element.find('inertial')
    if inertial is None:
        return name, _NOTHING
    com, rotation = _parse_origin(inertial.find('origin'), where)
    mass_element, inertia_element = inertial.find('mass'), inertial.find('inertia')
    if mass_element is None or inertia_element is None:
        raise ModelError(where, '<inertial> needs both <mass> and <inertia>')
    mass = _parse_numbers(mass_element.get('value', ''), 1, f'{where} mass')[0]
    inertia = rotation @ _parse_inertia(inertia_element, where) @ rotation.T
    return name, Solid(mass, com, inertia)


def _is_xacro(element: ElementTree.Element) -> bool:
    """Whether it is of xacro's own, or has an expression of it."""
    return _XACRO in element.tag or any('${' in v or '$(' in v for v in element.attrib.values())


def _parse_inertia(element: ElementTree.Element, where: str) -> Matrix3:
    extra = set(element.keys()) - set(INERTIA)
    values = {k: _parse_numbers(v, 1, f'{where} inertia {k}')[0] for k, v in element.items()}
    for key in extra:
        mirrored = f'i{key[2:]}{key[1:2]}'  # iyx of ixy
        if mirrored not in INERTIA or mirrored not in values:
            raise ModelError(f'{where} inertia', f'unknown attribute {key!r}')
        if values[key] != values[mirrored]:
            both = f'{key} = {values[key]} but {mirrored} = {values[mirrored]}'
            raise ModelError(f'{where} inertia', f'asymmetric: {both}')
    missing = [k for k in INERTIA if k not in values]
    if missing:
        raise ModelError(f'{where} inertia', f'missing {", ".join(missing)}')
    xx, xy, xz, yy, yz, zz = (values[k] for k in INERTIA)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _checked(
    links: dict[str, Solid], joints: dict[str, Joint], place: str, still: str
) -> dict[str, Solid]:
    """Links whose bodies are rigid ones.

    Links that are welded together are one body. Where one of them is none by itself, their first
    has all of it: files give brackets and antennas of grams moments that nobody has looked at. Of
    what does not move, the link `still` and all on it, nobody needs any.

    Raises:
        ModelError: see `check_inertia`; of the link that is none by itself.
    """
    out, below = dict(links), by_parent(joints)
    welded = {joint.child for joint in joints.values() if joint.kind == 'fixed'}
    for name in (name for name in links if name not in welded):
        names = [name]
        whole = _whole(links, below, names)
        faults = [(part, fault_of(links[part].mass, links[part].inertia)) for part in names]
        faults = [(part, why) for part, why in faults if why]
        if not faults:
            continue
        is_body = not fault_of(whole.mass, whole.inertia)
        if any(links[part].mass < 0.0 for part in names) or not (is_body or name == still):
            part, why = faults[0]
            raise ModelError(f'{place}: link {part!r}', why)
        out |= dict.fromkeys(names, _NOTHING) | ({name: whole} if is_body else {})
    return out


def _whole(
    links: dict[str, Solid], below: Mapping[str, Sequence[Joint]], names: list[str]
) -> Solid:
    """The link of a list with all that is welded to it, whose names are added."""
    welded = {}
    for name in names:  # which grows; chains may be longer than the interpreter's stack
        welded[name] = [joint for joint in below.get(name, ()) if joint.kind == 'fixed']
        names += [joint.child for joint in welded[name]]
    whole = {name: links[name] for name in names}
    for name in reversed(names):
        for joint in welded[name]:
            part = whole[joint.child].placed(joint.rotation, joint.translation)
            whole[name] = whole[name].joined(part)
    return whole[names[0]]


def _parse_joint(element: ElementTree.Element, place: str) -> Joint:
    name, kind = element.get('name', ''), element.get('type', '')
    where = f'{place}: joint {name!r}'
    if not name:
        raise ModelError(f'{place}: <joint>', 'has no name')
    if kind not in (*MOVING, 'fixed'):
        known = f'{", ".join(MOVING)} or fixed'
        raise ModelError(where, f'joint type {kind!r} is not supported (use {known})')
    parent, child = element.find('parent'), element.find('child')
    if parent is None or child is None:
        raise ModelError(where, 'needs <parent> and <child>')
    translation, rotation = _parse_origin(element.find('origin'), where)
    effort, velocity, position = _parse_limits(element.find('limit'), kind, where)
    fixed_axis = np.array([1.0, 0.0, 0.0])
    axis = fixed_axis if kind == 'fixed' else _parse_axis(element.find('axis'), where)
    ends, mimic = (parent.get('link', ''), child.get('link', '')), element.find('mimic')
    follows = None if mimic is None or kind == 'fixed' else _parse_mimic(mimic, where)
    where_it_is = rotation, translation, axis
    return Joint(name, kind, *ends, *where_it_is, effort, velocity, position, follows)


def _parse_mimic(element: ElementTree.Element, where: str) -> Mimic:
    leader = element.get('joint', '')
    if not leader:
        raise ModelError(f'{where} mimic', 'names no joint')
    given = (('multiplier', '1'), ('offset', '0'))
    numbers = (_parse_numbers(element.get(k, d), 1, f'{where} mimic {k}')[0] for k, d in given)
    return Mimic(leader, *numbers)


def _parse_limits(
    element: ElementTree.Element | None, kind: str, where: str
) -> tuple[float, float, tuple[float, float]]:
    """Limits of effort, velocity and position."""
    given = {} if element is None else element.attrib

    def limit(key: str) -> float:
        return _parse_numbers(given.get(key, '0'), 1, f'{where} {key} limit')[0]

    effort, velocity = (limit(key) or math.inf for key in ('effort', 'velocity'))
    low, high = -math.inf, math.inf
    if kind != 'continuous' and ('lower' in given or 'upper' in given):
        low, high = limit('lower'), limit('upper')
    if effort < 0.0 or velocity < 0.0 or low > high:
        limits = f'effort {effort:g}, velocity {velocity:g}, range [{low:g}, {high:g}]'
        raise ModelError(where, f'limits make no sense: {limits}')
    return effort, velocity, (low, high)


def _parse_axis(element: ElementTree.Element | None, where: str) -> Vector3:
    text = '1 0 0' if element is None else element.get('xyz', '')
    axis = np.array(_parse_numbers(text, 3, f'{where} axis'))
    norm = math.hypot(*axis)  # which may be infinite
    if abs(norm - 1.0) > 1e-3:
        raise ModelError(f'{where} axis', f'must be a unit vector, its length is {norm:g}')
    return axis / norm


def _parse_origin(element: ElementTree.Element | None, where: str) -> tuple[Vector3, Matrix3]:
    if element is None:
        return np.zeros(3), np.eye(3)
    translation = np.array(_parse_numbers(element.get('xyz', '0 0 0'), 3, f'{where} origin xyz'))
    rpy = _parse_numbers(element.get('rpy', '0 0 0'), 3, f'{where} origin rpy')
    return translation, _turned_by(*rpy) if any(rpy) else np.eye(3)


def _turned_by(roll: float, pitch: float, yaw: float) -> Matrix3:
    """Rotation of a URDF's angles, about the fixed axes x, then y, then z."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _parse_numbers(text: str, count: int, where: str) -> list[float]:
    try:  # Python's own also reads 1_000 and digits of other scripts
        numbers = [float(word) for word in text.encode('ascii').replace(b'_', b'?').split()]
    except ValueError as error:
        raise ModelError(where, f'expected {count} number(s), got {text!r}') from error
    if len(numbers) != count or not all(abs(n) <= LARGEST for n in numbers):
        why = f'expected {count} finite number(s), got {text!r}'
        raise ModelError(where, f'{why}; magnitudes end at {LARGEST:g}')
    return numbers


def _faults_of_tree(
    links: dict[str, Solid], joints: dict[str, Joint], root: str, place: str
) -> Iterator[tuple[str, str]]:
    """Why links and joints are not one tree: place and reason."""
    parents: dict[str, str] = {}
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                where = f'{place}: joint {joint.name!r}'
                yield where, f'names the link {end!r}, which does not exist'
        if joint.child in parents:
            both = f'{parents[joint.child]!r} and {joint.name!r}'
            why = f'has two parents (joints {both}): closed loops are not supported'
            yield f'{place}: link {joint.child!r}', why
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if roots != [root]:
        found = ', '.join(roots) or 'none'
        yield place, f'must be one tree, but its links without a parent are: {found}'
    below = by_parent(joints)
    reached, waiting = {root}, [root]
    while waiting:
        new = [j.child for j in below.get(waiting.pop(), ()) if j.child not in reached]
        reached.update(new)
        waiting += new
    if len(reached) != len(links):
        yield place, f'links form a loop: {", ".join(sorted(set(links) - reached))}'
