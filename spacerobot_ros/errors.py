"""The family of errors that the project raises on purpose.

Each carries what a user needs to mend the input: the place, the reason and, where it helps, what
to do. Command line and nodes print `str(error)` as one line and exit with status 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

_LONGEST, _LONGEST_PLACE = 1000, 300  # characters of a line, which may quote the input


def shortened(text: str, most: int) -> str:
    """A text of at most so many characters, its end left out where it has more."""
    return text if len(text) <= most else f'{text[: most - 4]} ...'


def in_a_line(text: str) -> str:
    """A text without what moves or colours a terminal's cursor."""
    return ''.join(c if c.isprintable() else ' ' if c.isspace() else ascii(c)[1:-1] for c in text)


def did_you_mean(given: str, known: Iterable[str], otherwise: str) -> str:
    """The known name that is most like one that was given, as a question; else other words."""
    close = difflib.get_close_matches(given, list(known), n=1)
    return f'did you mean {close[0]!r}?' if close else otherwise


class SpaceRobotError(Exception):
    """Base of every error raised on purpose by this project."""


class PlacedError(SpaceRobotError, ValueError):
    """Something that can't be used, with its place.

    Args:
        place: Where: file, parameter name, link or joint, such as `robot.joints[1]`.
        reason: What is wrong there and what would be right.
    """

    def __init__(self, place: str, reason: str) -> None:
        place = shortened(in_a_line(place), _LONGEST_PLACE)
        reason = shortened(in_a_line(reason), _LONGEST - len(place) - 2)
        super().__init__(f'{place}: {reason}')
        self.place = place
        self.reason = reason

    def __reduce__(self) -> tuple[type[PlacedError], tuple[str, str]]:
        """From another process it comes as it was."""
        return type(self), (self.place, self.reason)


def refuse_all(faults: Sequence[PlacedError], place: str) -> None:
    """Raise what is wrong, all of it at once; nothing where nothing is.

    Args:
        faults: Of one kind.
        place: Of all of them; the beginning of their own places.

    Raises:
        PlacedError: of their kind.
    """
    if len(faults) > 1:
        parts = (f'{f.place.removeprefix(place).lstrip(": ")}: {f.reason}' for f in faults)
        raise type(faults[0])(place, f'{len(faults)} faults: {"; ".join(parts)}')
    for fault in faults:
        raise fault


class ConfigurationError(PlacedError):
    """A robot file, parameter or option that can't be used."""


class ModelError(ConfigurationError):
    """A URDF that doesn't describe a physical robot that this project can handle."""


class RecordingError(PlacedError):
    """A recording that can't be read, or that lacks what the task needs."""


class MessageRejectedError(SpaceRobotError, ValueError):
    """One message or sample that must not be used; the loop goes on without it."""


class IdentificationError(SpaceRobotError, ValueError):
    """Data and model from which nothing can be identified, with the reason."""


class SimulationDivergedError(SpaceRobotError, ArithmeticError):
    """The integration produced a non-finite state.

    Args:
        time: Simulated time of the failing step [s].
        reason: What became non-finite and the last finite magnitude.
    """

    def __init__(self, time: float, reason: str) -> None:
        super().__init__(f'the simulation diverged at t = {time:.6g} s: {reason}')
        self.time = time
        self.reason = reason

    def __reduce__(self) -> tuple[type[SimulationDivergedError], tuple[float, str]]:
        """From another process it comes as it was."""
        return type(self), (self.time, self.reason)
