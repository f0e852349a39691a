"""Ranges of a Monte Carlo campaign: which values of a robot file are drawn, and how (YAML)."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.stats

from ..effects.robot_file import load_robot_file
from ..errors import ConfigurationError
from ..json_values import plain
from ..model.files import read_parameters, read_yaml
from ..model.robot import Robot
from ..model.settings import Settings, parse_settings

MIDDLE = -1
"""The run with the median of everything that is drawn."""
_INERTIA = 'inertia.'
_KEYS = ('runs', 'duration', 'seed', 'effects', 'draw')
_ENTRY = re.compile(r'([^\[\]]+)((?:\[\d+\])*)')
_CONTROLLERS = ('controller', 'adaptive', 'reference')


@dataclass(frozen=True, eq=False)
class Ranges:
    """What is drawn for each run of a robot file.

    Args:
        runs: How many. duration: Of each [s]. seed: Of all.
        robot_path: The robot file: what the controller believes.
        effects: Effects of the machine beside the file's, as its section `effects`.
        draw: Distribution of scipy.stats of each key: a place in the robot file, such as
            `truth.target_momentum[0]`, `sensors.gyro_std` or `effects.worn.coefficient`, or
            `inertia.LINK`, a factor on mass, first moment and inertia of a link.
    """

    runs: int
    duration: float
    seed: int
    robot_path: str
    effects: Mapping[str, Any]
    draw: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def robot_file(self) -> Any:
        """The loaded robot file."""
        return load_robot_file(self.robot_path)

    def values(self, run: int) -> dict[str, float]:
        """What is drawn for a run, by key; other keys and runs change nothing of it."""
        return {key: self._value(key, law, run) for key, law in self.draw.items()}

    def machine(self, run: int) -> tuple[Settings, Robot]:
        """Settings of the machine of a run, and the robot whose truth they are.

        Raises:
            ConfigurationError: a value that can't be.
        """
        content = deepcopy(self._content)
        values = self.values(run)
        factors = {key: values.pop(key) for key in self.draw if key.startswith(_INERTIA)}
        for key, value in values.items():
            _put(content, key, value)
        settings = parse_settings(content, 'medians: ' if run == MIDDLE else f'run {run}: ')
        simulator = replace(settings.simulator, seed=self._noise_seed(run))
        settings = replace(settings, simulator=simulator)
        return _scaled(settings, self.robot_file.robot, factors), self.robot_file.robot

    def believed(self, machine: Settings) -> Settings:
        """Settings of the controller of a machine: the file's but for what is the controller's."""
        own = {name: getattr(machine, name) for name in _CONTROLLERS}
        return replace(self.robot_file.settings, simulator=machine.simulator, **own)

    @cached_property
    def _content(self) -> dict[str, Any]:
        content = plain(read_parameters(Path(self.robot_path)))
        content['effects'] = {**(content.get('effects') or {}), **plain(self.effects)}
        return dict(content)

    def _value(self, key: str, law: Any, run: int) -> float:
        if run == MIDDLE:
            return float(law.median())
        rng = np.random.default_rng([self.seed, run, zlib.crc32(key.encode())])
        return float(law.rvs(random_state=rng))

    def _noise_seed(self, run: int) -> int:
        own = [self.seed, run] if run != MIDDLE else self.seed
        return int(np.random.default_rng(own).integers(2**31))


def load_ranges(path: str, robot_path: str, runs: int | None = None) -> Ranges:
    """Read and check a file of ranges.

    Args:
        path: The YAML (docs/fleet.md).
        robot_path: The robot file.
        runs: In place of the file's.

    Raises:
        ConfigurationError: not such a file, or ranges whose medians are no machine.
    """
    content = read_yaml(Path(path), 'ranges')
    if not isinstance(content, Mapping) or not isinstance(content.get('draw'), Mapping):
        raise ConfigurationError(path, "expected a map with 'draw': what is drawn, and how")
    if unknown := [key for key in content if key not in _KEYS]:
        raise ConfigurationError(path, f'unknown key {unknown[0]!r} (known: {", ".join(_KEYS)})')
    if not isinstance(effects := content.get('effects') or {}, Mapping):
        raise ConfigurationError(f'{path}: effects', 'expected a map of effects by their names')
    ranges = Ranges(
        int(runs or _number(path, content, 'runs', 1000)),
        _number(path, content, 'duration', 20.0),
        int(_number(path, content, 'seed', 0)),
        robot_path,
        effects,
        {key: _distribution(f'{path}: draw.{key}', spec) for key, spec in content['draw'].items()},
    )
    ranges.machine(MIDDLE)
    return ranges


def _number(path: str, content: Mapping[str, Any], key: str, default: float) -> float:
    value = content.get(key, default)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not np.isfinite(value) or value < 0 or (value == 0 and key != 'seed'):
        raise ConfigurationError(f'{path}: {key}', f'must be a number above zero, got {value!r}')
    return float(value)


def _distribution(place: str, spec: Any) -> Any:
    """A frozen distribution of scipy.stats."""
    if not isinstance(spec, Mapping) or 'distribution' not in spec:
        raise ConfigurationError(place, 'expected {distribution: NAME, ...} as in scipy.stats')
    name = spec['distribution']
    family = getattr(scipy.stats, str(name), None)
    if not isinstance(family, scipy.stats.rv_continuous | scipy.stats.rv_discrete):
        raise ConfigurationError(place, f'{name!r} is no distribution of scipy.stats')
    given = {key: value for key, value in spec.items() if key != 'distribution'}
    try:
        law = family(**given)
        middle = float(law.median())
    except (TypeError, ValueError) as error:
        raise ConfigurationError(place, f'{name}: {" ".join(str(error).split())}') from error
    if not np.isfinite(middle):
        raise ConfigurationError(place, f'{name} has no median with {given}')
    return law


def _put(content: dict[str, Any], key: str, value: float) -> None:
    """Replace a number in nested maps and lists.

    Raises:
        ConfigurationError: no such place.
    """
    *above, last = key.split('.')
    at: Any = content
    for name in above:
        at = at.setdefault(name, {}) if isinstance(at, dict) else None
    match = _ENTRY.fullmatch(last)
    if not isinstance(at, dict) or match is None or not above:
        raise ConfigurationError(f'draw.{key}', 'is no place in a robot file')
    name, indices = match[1], [int(i) for i in re.findall(r'\d+', match[2])]
    if not indices:
        at[name] = value
        return
    at = at.get(name)
    for i in indices[:-1]:
        at = at[i] if isinstance(at, list) and i < len(at) else None
    if not isinstance(at, list) or indices[-1] >= len(at):
        why = f'the robot file states no such entry: give {name} there as a list'
        raise ConfigurationError(f'draw.{key}', why)
    at[indices[-1]] = value


def _scaled(settings: Settings, robot: Robot, factors: Mapping[str, float]) -> Settings:
    """Settings whose truth has the inertia of some links times a factor, by the key drawn."""
    truth, names = settings.truth, [body.name for body in robot.bodies]
    rows = np.reshape(truth.inertial_parameters, (-1, 10)).tolist()
    found = dict(zip(truth.links, rows, strict=False))
    for key, factor in factors.items():
        if (link := key.removeprefix(_INERTIA)) not in names:
            raise ConfigurationError(f'draw.{key}', f'no such body (bodies: {", ".join(names)})')
        row = found.get(link, robot.inertial_parameters[names.index(link)])
        found[link] = (factor * np.asarray(row)).tolist()
    flat = tuple(value for row in found.values() for value in row)
    return replace(settings, truth=replace(truth, links=tuple(found), inertial_parameters=flat))
