"""What a robot file's bodies are uncertain by: the one prior of identification and adaptation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, fields, replace
from typing import Any

from ..errors import ConfigurationError, did_you_mean
from .body import Frames
from .schema import FreeMaps, param, parse_number


@dataclass(frozen=True, slots=True)
class BodyUncertainty:
    """One standard deviation of a body's numbers, relative.

    Args:
        mass: Of a mass.
        com: Of a centre of mass, a share of the body's radius of gyration.
        inertia: Of a body's extents (the factor of its second moments); its moments of inertia
            vary by some one and a half times as much.
    """

    mass: float = param(0.1, above=0.0, maximum=1.0)
    com: float = param(0.1, above=0.0, maximum=1.0)
    inertia: float = param(0.15, above=0.0, maximum=1.0)


USUAL = BodyUncertainty()
"""Of bodies that nobody states it of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintySettings(BodyUncertainty):
    """How far the file's bodies may be off, one standard deviation, relative.

    The identification scales all of them together by a factor that the data find, from a tenth to
    ten. `links` has the same three by link, where a link differs from the others.

    Args:
        links: As robot.uncertainty of the same name, of one link.
    """

    links: FreeMaps = field(default_factory=dict)


def body_uncertainties(
    options: UncertaintySettings, frames: Frames, count: int
) -> tuple[BodyUncertainty, ...]:
    """One a body; links that are one body have the largest of theirs.

    Args:
        options: Of the robot file.
        frames: Of all links: their body first.
        count: Number of bodies.

    Raises:
        ConfigurationError: a link that is not there, an unknown name, a number out of bounds.
    """
    common = BodyUncertainty(options.mass, options.com, options.inertia)
    out: list[BodyUncertainty | None] = [None] * count
    for link, values in options.links.items():
        place = f'robot.uncertainty.links.{link}'
        if link not in frames:
            hint = did_you_mean(link, frames, f'it has {", ".join(frames)}')
            raise ConfigurationError(place, f'the URDF has no link {link!r} ({hint})')
        own, index = _of_link(common, values, place), frames[link][0]
        before = out[index] or own
        out[index] = BodyUncertainty(*map(max, astuple(before), astuple(own)))
    return tuple(one or common for one in out)


def _of_link(common: BodyUncertainty, values: Mapping[str, Any], place: str) -> BodyUncertainty:
    known = {f.name: f.metadata['allowed'] for f in fields(common)}
    for name, value in values.items():
        if name not in known:
            raise ConfigurationError(f'{place}.{name}', f'is none of {", ".join(known)}')
        number = parse_number(value, f'{place}.{name}')
        known[name].check(number, f'{place}.{name}')
        common = replace(common, **{name: number})
    return common
