"""URDF text to checked links and joints, before any dynamics library sees them.

Only what a rigid tree needs is read: links with inertials, joints with origin, axis, limits and
friction.
Everything unphysical or unsupported is refused here with the link or joint named, because dynamics
libraries accept most of it in silence.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from ..errors import ModelError, PlacedError, refuse_all
from ..types import Matrix3, Vector3
from .files import MOST_URDF
from .rigid_body import Solid, fault_of
from .schema import LARGEST
from .urdf_joints import FRICTION, MOVING, Joint, Mimic, with_held

INERTIA = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
Named = TypeVar('Named')
_NOTHING = Solid(0.0, np.zeros(3), np.zeros((3, 3)))
_ENDLESS = r'[+-]?(inf|infinity|1\.79769\d*e\+?308)'  # no limit, or the largest of all doubles
_ROUNDING = 1e-12  # m^2, of the mass: all of it within a thousandth of a millimetre
_XACRO = 'ros.org/wiki/xacro'  # end of the namespace of its elements
_UNDONE = ('arg', 'if', 'include', 'insert_block', 'macro', 'property', 'unless')


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
    root = _root(text, place)
    faults: list[PlacedError] = []
    given = _named(root.findall('link'), _parse_link, place, faults)
    joints = _named(root.findall('joint'), _parse_joint, place, faults)
    refuse_all(faults, place)
    joints = with_held(joints, held or {})
    children = {joint.child for joint in joints.values()}
    base = next((name for name in given if name not in children), '')
    wrong = _faults_of_tree(given, joints, base, place)
    refuse_all([ModelError(where, why) for where, why in wrong], place)
    links = {name: link.solid for name, link in given.items()}
    axes = {name: link.axes for name, link in given.items()}
    checked = _checked(links, axes, joints, place, base if is_on_ground else '')
    return Tree(root.get('name', 'robot'), base, checked, joints)


def _root(text: str, place: str) -> ElementTree.Element:
    """The root element of a URDF, as every reader of these takes it.

    Its own name space is none, and dashes in comments are no fault.
    """
    try:
        root = ElementTree.fromstring(re.sub(r'<!--.*?-->', '', text, flags=re.DOTALL))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ModelError(place, f'not well-formed XML: {error}') from error
    is_whole = any(element.tag.endswith('link') for element in root)
    if any(_is_for_xacro(element, is_whole) for element in root.iter()):
        why = 'is xacro, not URDF: convert it with `xacro FILE > robot.urdf` and name that'
        raise ModelError(place, why)
    space, _, tag = root.tag.rpartition('}')
    if tag != 'robot':
        raise ModelError(place, f'the root element is <{root.tag}>, expected <robot>')
    for element in root.iter() if space else ():
        element.tag = element.tag.removeprefix(f'{space}}}')
    return root


class _Link(NamedTuple):
    """A link, and what takes the axes of its `<inertial>` to its own."""

    solid: Solid
    axes: Matrix3


def by_parent(joints: dict[str, Joint]) -> dict[str, list[Joint]]:
    """The joints below each link that has some, in URDF order."""
    below: dict[str, list[Joint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    return below


def _named(
    elements: Iterable[ElementTree.Element],
    parse: Callable[[ElementTree.Element, str], Named],
    place: str,
    faults: list[PlacedError],
) -> dict[str, Named]:
    """Elements by name; what is wrong of them is added to the faults."""
    named: dict[str, Named] = {}
    for element in elements:
        name = element.get('name', '')
        try:
            if not name:
                raise ModelError(f'{place}: <{element.tag}>', 'has no name')
            if name in named:
                raise ModelError(f'{place}: {element.tag} {name!r}', 'this name is used twice')
            named[name] = parse(element, f'{place}: {element.tag} {name!r}')
        except ModelError as error:
            faults.append(error)
    return named


def _parse_link(element: ElementTree.Element, where: str) -> _Link:
    inertial = element.find('inertial')
    if inertial is None:
        return _Link(_NOTHING, np.eye(3))
    com, rotation = _parse_origin(inertial.find('origin'), where)
    mass_element, inertia_element = inertial.find('mass'), inertial.find('inertia')
    if mass_element is None or inertia_element is None:
        raise ModelError(where, '<inertial> needs both <mass> and <inertia>')
    mass = _parse_numbers(mass_element.get('value', ''), 1, f'{where} mass')[0]
    inertia = _parse_inertia(inertia_element, where)
    if np.max(np.abs(inertia)) < _ROUNDING * (mass or 1.0):
        inertia = np.zeros((3, 3))
    return _Link(Solid(mass, com, rotation @ inertia @ rotation.T), rotation)


def _is_for_xacro(element: ElementTree.Element, is_whole: bool) -> bool:
    """Whether xacro has something to do with it, unlike what it leaves over of a whole file."""
    space, _, tag = element.tag.rpartition('}')
    if space.endswith(_XACRO) and (tag in _UNDONE or not is_whole):
        return True
    return any('${' in v or '$(' in v for v in element.attrib.values())


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
    links: dict[str, Solid],
    axes: Mapping[str, Matrix3],
    joints: dict[str, Joint],
    place: str,
    still: str,
) -> dict[str, Solid]:
    """Links whose bodies are rigid ones.

    Links that are welded together are one body. Where one of them is none by itself, their first
    has all of it: files give brackets and antennas of grams moments that nobody has looked at. Of
    what does not move, the link `still` and all on it, nobody needs any.

    Raises:
        ModelError: see `check_inertia`; of every link that is none by itself.
    """
    refused: list[PlacedError] = []
    out, below = dict(links), by_parent(joints)
    welded = {joint.child for joint in joints.values() if joint.kind == 'fixed'}
    for name in (name for name in links if name not in welded):
        names = [name]
        whole = _whole(links, below, names)
        solids = ((part, links[part]) for part in names)
        faults = [(part, fault_of(s.mass, s.inertia, axes[part])) for part, s in solids]
        faults = [(part, why) for part, why in faults if why]
        if not faults:
            continue
        is_body = not fault_of(whole.mass, whole.inertia)
        if any(links[part].mass < 0.0 for part in names) or not (is_body or name == still):
            part, why = faults[0]
            refused.append(ModelError(f'{place}: link {part!r}', why))
            continue
        out |= dict.fromkeys(names, _NOTHING) | ({name: whole} if is_body else {})
    refuse_all(refused, place)
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


def _parse_joint(element: ElementTree.Element, where: str) -> Joint:
    name, kind = element.get('name', ''), element.get('type', '')
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
    joint = Joint(name, kind, *ends, *where_it_is, effort, velocity, position, follows)
    return joint if kind == 'fixed' or follows else _with_friction(joint, element, where)


def _with_friction(joint: Joint, element: ElementTree.Element, where: str) -> Joint:
    """The joint with what `<dynamics>` says of it."""
    dynamics, found = element.find('dynamics'), dict.fromkeys(FRICTION, 0.0)
    given = {} if dynamics is None else dynamics.attrib
    for key in FRICTION:
        at, text = f'{where} dynamics {key}', given.get(key, '0')
        try:
            (found[key],) = _parse_numbers(text, 1, at)
        except ModelError:
            found[key] = -1.0
        if found[key] < 0.0:
            why = 'is no friction: write a finite number from 0 on, 0 where it is not known'
            raise ModelError(at, f'{text!r} {why}')
    return replace(joint, damping=found['damping'], friction=found['friction'])


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
        text = given.get(key, '0')
        if re.fullmatch(_ENDLESS, text.strip().lower()):
            return -math.inf if '-' in text[:1] else math.inf
        return _parse_numbers(text, 1, f'{where} {key} limit')[0]

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
    links: Collection[str], joints: dict[str, Joint], root: str, place: str
) -> Iterator[tuple[str, str]]:
    """Why links and joints are not one tree: place and reason."""
    parents, is_tree = dict[str, str](), True
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                is_tree = False
                where = f'{place}: joint {joint.name!r}'
                yield where, f'names the link {end!r}, which does not exist'
        if joint.child in parents:
            is_tree = False
            both = f'{parents[joint.child]!r} and {joint.name!r}'
            why = f'has two parents (joints {both}): closed loops are not supported'
            yield f'{place}: link {joint.child!r}', why
        parents[joint.child] = joint.name
    if not is_tree:
        return
    roots = [name for name in links if name not in parents]
    if roots != [root]:
        found = ', '.join(roots) or 'none'
        yield place, f'must be one tree, but its links without a parent are: {found}'
        return
    below = by_parent(joints)
    reached, waiting = {root}, [root]
    while waiting:
        new = [j.child for j in below.get(waiting.pop(), ()) if j.child not in reached]
        reached.update(new)
        waiting += new
    if len(reached) != len(links):
        yield place, f'links form a loop: {", ".join(sorted(set(links) - reached))}'
