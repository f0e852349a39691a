"""A learned law as a table: linear between knots of one or two inputs, constant outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy

from ...errors import ConfigurationError
from ...model.schema import parse_number
from ...types import Array


@dataclass(frozen=True, slots=True, eq=False)
class TableForm:
    """Values at knots.

    Args:
        knots: Of each input, increasing.
        values: One a knot, or (first, second) knots.
    """

    knots: tuple[Array, ...]
    values: Array

    name: ClassVar[str] = 'table'
    keys: ClassVar[tuple[str, ...]] = ('knots', 'values')
    parameters: ClassVar[tuple[str, ...]] = ()
    ratio: ClassVar[float] = 0.0
    has_history: ClassVar[bool] = False

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.knots)

    def __call__(self, inputs: Sequence[Array], parameters: Mapping[str, float]) -> Array:
        """(N, 1) the table's value of inputs (N,)."""
        places = [
            np.interp(x, knots, np.arange(len(knots)))
            for x, knots in zip(inputs, self.knots, strict=True)
        ]
        return np.asarray(scipy.ndimage.map_coordinates(self.values, places, order=1)[:, None])

    def entry(self) -> dict[str, Any]:
        """As in a robot file."""
        knots = {f'{"xy"[i]}': knots.tolist() for i, knots in enumerate(self.knots)}
        return {'form': self.name, 'knots': knots, 'values': self.values.ravel().tolist()}

    @classmethod
    def read(cls, given: Mapping[str, Any], place: str) -> TableForm:
        """From `knots: {x: [...], y: [...]}` and `values`, the last input's fastest.

        Raises:
            ConfigurationError: knots that do not increase, or values that are not one a knot.
        """
        knots, values = given.get('knots'), given.get('values')
        if not isinstance(knots, Mapping) or sorted(knots) not in (['x'], ['x', 'y']):
            raise ConfigurationError(
                f'{place}.knots', 'expected {x: [...]} or {x: [...], y: [...]}'
            )
        axes = tuple(_numbers(knots[key], f'{place}.knots.{key}') for key in sorted(knots))
        for key, axis in zip('xy', axes, strict=False):
            if len(axis) < 2 or np.any(np.diff(axis) <= 0.0):
                raise ConfigurationError(f'{place}.knots.{key}', 'must be two or more, increasing')
        flat = _numbers(values, f'{place}.values')
        shape = tuple(len(axis) for axis in axes)
        if len(flat) != np.prod(shape):
            why = f'expected {" x ".join(map(str, shape))} numbers, got {len(flat)}'
            raise ConfigurationError(f'{place}.values', why)
        return cls(axes, flat.reshape(shape))


def _numbers(given: Any, place: str) -> Array:
    if isinstance(given, str | Mapping) or not hasattr(given, '__iter__'):
        raise ConfigurationError(place, f'expected a list of numbers, got {given!r}')
    return np.array([parse_number(value, f'{place}[{i}]') for i, value in enumerate(given)])
