"""What a robot file's bodies are uncertain by: the one prior of identification and adaptation."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ..errors import ConfigurationError
from .body import Frames
from .schema import FreeMaps, param, parse_number


@dataclass(frozen=True, slots=True)
class BodyUncertainty:
    """One standard deviation of a body's numbers, relative.

    Args:
        mass: Of the mass.
        com: Of the centre of mass, a share of the body's radius of gyration.
        inertia: Of the body's extents (the factor of its second moments); moments of inertia
            vary by some one and a half times as much.
    """

    mass: float
    com: float
    inertia: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintySettings:
    """How far the file's bodies may be off, one standard deviation, relative.

    The identification scales all of them together by a factor that the data find, from a tenth to
    ten. `links` has the same three by link, where a link differs from the others.

    Args:
        mass: Of a mass.
        com: Of a centre of mass, a share of the body's radius of gyration.
        inertia: Of a body's extents; its moments of inertia vary by some one and a half times as
            much.
    """

    mass: float = param(0.1, above=0.0, maximum=1.0)
    com: float = param(0.1, above=0.0, maximum=1.0)
    inertia: float = param(0.15, above=0.0, maximum=1.0)
    links: FreeMaps = field(default_factory=dict)

    @property
    def common(self) -> BodyUncertainty:
        """Of links that `links` does not name."""
        return BodyUncertainty(self.mass, self.com, self.inertia)


USUAL = UncertaintySettings().common
"""Of bodies that nobody states it of."""


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
    common = options.common
    out: list[BodyUncertainty | None] = [None] * count
    for link, values in options.links.items():
        place = f'robot.uncertainty.links.{link}'
        if link not in frames:
            close = difflib.get_close_matches(link, list(frames), n=1)
            meant = f'did you mean {close[0]!r}?' if close else f'it has {", ".join(frames)}'
            raise ConfigurationError(place, f'the URDF has no link {link!r} ({meant})')
        own, index = _of_link(common, values, place), frames[link][0]
        before = out[index]
        out[index] = own if before is None else _larger(before, own)
    return tuple(one or common for one in out)


def _of_link(common: BodyUncertainty, values: Mapping[str, Any], place: str) -> BodyUncertainty:
    limits = {f.name: f.metadata['allowed'] for f in fields(UncertaintySettings) if f.metadata}
    names = [f.name for f in fields(BodyUncertainty)]
    found = {}
    for name, value in values.items():
        if name not in names:
            raise ConfigurationError(f'{place}.{name}', f'is none of {", ".join(names)}')
        found[name] = parse_number(value, f'{place}.{name}')
        limits[name].check(found[name], f'{place}.{name}')
    return replace(common, **found)


def _larger(one: BodyUncertainty, other: BodyUncertainty) -> BodyUncertainty:
    names = (f.name for f in fields(BodyUncertainty))
    return BodyUncertainty(*(max(getattr(one, n), getattr(other, n)) for n in names))
