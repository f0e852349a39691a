"""Every parameter of a robot file, once: type, unit, bounds and meaning.

A robot file is a ROS 2 parameter file (`/**: ros__parameters:`) shared by all nodes and by the
command line, so one schema serves all of them: each section below is a frozen dataclass whose
fields carry unit, bounds and meaning (`model.schema`). `parse_settings` turns a nested mapping
into a `Settings`, refusing unknown keys, wrong types, wrong lengths and non-finite or
out-of-bound numbers with the parameter named.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..schema import FloatList, FreeMaps, TextList, parse_section
from .controller_settings import (
    ADAPTIVE_LAWS,
    COMPUTED_TORQUE_LAWS,
    CONSISTENCIES,
    AdaptationSettings,
    ControllerSettings,
    ReferenceSettings,
)
from .estimator_settings import ExcitationSettings, IdentifierSettings, MonitorSettings
from .robot_settings import RobotSettings, SensorSettings, WheelSettings
from .simulator_settings import InitialSettings, SimulatorSettings, TruthSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All sections of a robot file.

    `effects` holds physical effects that the model believes in, under free names, as {effect: id,
    where: place, parameters...}; `effects.catalogue.bind_effects` checks them against the robot.
    """

    robot: RobotSettings
    sensors: SensorSettings = field(default_factory=SensorSettings)
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    initial: InitialSettings = field(default_factory=InitialSettings)
    truth: TruthSettings = field(default_factory=TruthSettings)
    simulator: SimulatorSettings = field(default_factory=SimulatorSettings)
    identifier: IdentifierSettings = field(default_factory=IdentifierSettings)
    monitor: MonitorSettings = field(default_factory=MonitorSettings)
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    adaptive: AdaptationSettings = field(default_factory=AdaptationSettings)
    excitation: ExcitationSettings = field(default_factory=ExcitationSettings)
    effects: FreeMaps = field(default_factory=dict)

    def changed(self, values: Mapping[str, Any]) -> Settings:
        """Settings with other values by name, such as `simulator.seed`; None leaves one as is."""
        settings = self
        for name, value in values.items():
            section, _, key = name.partition('.')
            if value is not None:
                part = replace(getattr(settings, section), **{key: value})
                settings = replace(settings, **{section: part})
        return settings


def parse_settings(values: Mapping[str, Any], place: str = '') -> Settings:
    """Validate a nested mapping (the content of `ros__parameters`) against the schema.

    Args:
        values: Nested mapping of sections.
        place: Prefix for error messages, such as the file's name.

    Returns:
        The typed, validated settings.

    Raises:
        ConfigurationError: on an unknown key, wrong type, wrong length, or non-finite or
            out-of-bound number.
    """
    return typing.cast(Settings, parse_section(Settings, values, place))


__all__ = [
    'ADAPTIVE_LAWS',
    'COMPUTED_TORQUE_LAWS',
    'CONSISTENCIES',
    'AdaptationSettings',
    'ControllerSettings',
    'ExcitationSettings',
    'FloatList',
    'IdentifierSettings',
    'InitialSettings',
    'MonitorSettings',
    'ReferenceSettings',
    'RobotSettings',
    'SensorSettings',
    'Settings',
    'SimulatorSettings',
    'TextList',
    'TruthSettings',
    'WheelSettings',
    'parse_settings',
]
