"""Types of command-line arguments that say what is wrong with a value."""

from __future__ import annotations

import argparse
import math


def positive_float(text: str) -> float:
    """A finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number') from None
    if not math.isfinite(value) or value <= 0.0:
        raise argparse.ArgumentTypeError(f'{text} must be finite and above zero')
    return value


def seed(text: str) -> int:
    """A whole number, zero or above."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} must be zero or above')
    return value


class Formatter(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Keeps the layout of descriptions and shows defaults."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        """Defaults of None or False say nothing."""
        if action.default is None or action.default is False:
            return action.help
        return super()._get_help_string(action)
