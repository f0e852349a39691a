"""`spacerobot excite --separate`: the motion that best tells two effects apart."""

from __future__ import annotations

import argparse
import json
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError

if TYPE_CHECKING:
    from ..excitation.separation import Flight, Place, Separated, Told
    from ..model.robot import Robot


_NESTED = 1e-3  # sine of the angle between signatures; below, one is a special case of the other


def run_separate(args: argparse.Namespace) -> int:
    """Design, write, print; 0 when the motion is written."""
    from ..effects.robot_file import load_robot_file
    from ..excitation.output import write_trajectory
    from ..excitation.separation import budget, separate
    from .excite import with_options
    from .terminal import progress

    _refuse_options(args)
    file = with_options(load_robot_file(args.robot), args)
    first, second = (parse_place(text, file.robot) for text in args.separate)
    if first.name == second.name:
        raise ConfigurationError('--separate', f'{first.name} is given twice')
    with progress() as stage:
        advance = stage('designing', budget(file, args.duration))
        found = separate(file, first, second, args.duration, advance)
    best = found.best
    write_trajectory(best.motions, best.x, args.robot, args.output)
    if args.json:
        print(json.dumps(_to_dict(first, second, found), indent=2, allow_nan=False))
    else:
        _print(first, second, found)
        print(f'written: {args.output}')
    return 0


def parse_place(text: str, robot: Robot) -> Place:
    """`effect` or `effect@where`.

    Raises:
        ConfigurationError: no such effect, or no such place on this robot.
    """
    from ..effects.catalogue import CATALOGUE
    from ..excitation.separation import Place

    name, _, place = text.partition('@')
    if name not in CATALOGUE:
        near = get_close_matches(name, CATALOGUE, n=3)
        hint = f' (did you mean {", ".join(near)}?)' if near else ''
        raise ConfigurationError('--separate', f'no effect {name!r}{hint}')
    effect, where = CATALOGUE[name], place or None
    places = effect.places(robot)
    if where not in places:
        known = ', '.join(name if p is None else f'{name}@{p}' for p in places)
        raise ConfigurationError('--separate', f'{text!r} is not one of {known}')
    if effect.needs_free_base and not robot.is_free:
        raise ConfigurationError('--separate', f'{name} is not seen on a fixed base')
    return Place(effect, where)


def _refuse_options(args: argparse.Namespace) -> None:
    for option in ('criterion', 'report'):
        if getattr(args, option) is not None:
            raise ConfigurationError(f'--{option}', 'has no meaning with --separate')


def _to_dict(first: Place, second: Place, found: Separated) -> dict[str, Any]:
    from ..json_values import json_value

    values = {
        'schema': 1,
        'separate': [first.name, second.name],
        'tried': found.tried,
        'best': _flight(found.best),
        'robot_file': None if found.own is None else _flight(found.own),
    }
    return dict(json_value(values))


def _flight(flight: Flight) -> dict[str, Any]:
    return {
        'origin': flight.origin,
        'duration': flight.motions.family.duration,
        'sides': [
            {'seen': told.seen, 'told': told.told, 'sine': told.sine, 'smallest': told.smallest}
            for told in (flight.first, flight.second)
        ],
    }


def _print(first: Place, second: Place, found: Separated) -> None:
    best = found.best
    print(
        f'best of {found.tried} motions: {best.origin}, {best.motions.family.duration:g} s; '
        "told apart: noise standard deviations of the part of an effect's plausible size that "
        'the other can not imitate'
    )
    rows: list[tuple[str, ...]] = [
        ('effect', 'from', 'seen', 'told apart', 'smallest told, of plausible size', 'motion')
    ]
    for name, flight in (('this one', best), ('robot file', found.own)):
        if flight is not None:
            rows.append(_row(first, second, flight.first, name))
            rows.append(_row(second, first, flight.second, name))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        print(
            '  '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )
    if min(best.first.sine, best.second.sine) < _NESTED:
        print(
            'note: one of them is all but a special case of the other; no motion tells it from '
            'the more general one'
        )


def _row(own: Place, other: Place, told: Told, name: str) -> tuple[str, ...]:
    smallest = f'{told.smallest:.3g}' if told.told > 0.0 else 'never'
    return own.name, other.name, f'{told.seen:.4g}', f'{told.told:.4g}', smallest, name
