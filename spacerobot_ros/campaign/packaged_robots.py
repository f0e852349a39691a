"""The robot files of the package as the campaigns fly them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from ..effects.robot_file import RobotFile, load_robot_file
from ..model.loader import package_folder
from ..model.motion_settings import ReferenceSettings
from ..types import Array

RATE = 100.0
"""Of joints and gyro [Hz]; the tracker has a tenth."""


@cache
def packaged(name: str) -> RobotFile:
    """A robot file of folder `config`."""
    return load_robot_file(package_folder('spacerobot_ros') / 'config' / f'{name}.yaml')


def flown(name: str, seed: int = 0, **sections: Any) -> RobotFile:
    """A robot file with 100 Hz sensors, under computed torque.

    Args:
        name: Of the file.
        seed: Of the sensors' noise.
        sections: Other settings, by their names.
    """
    file = packaged(name)
    settings = file.settings
    rates: dict[str, Any] = {'period': 1.0 / RATE, 'joint_rate': RATE, 'imu_rate': RATE}
    simulator = replace(settings.simulator, **rates, attitude_rate=0.1 * RATE, seed=seed)
    controller = replace(settings.controller, law='computed_torque')
    changed = replace(settings, simulator=simulator, controller=controller, **sections)
    return replace(file, settings=changed)


def fourier(
    duration: float, sine: Array, cosine: Array, repeat: bool = False
) -> ReferenceSettings:
    """A motion of n joints from amplitudes (n, harmonics) of sine and cosine [rad/s]."""
    return ReferenceSettings(
        kind='fourier',
        duration=duration,
        harmonics=sine.shape[1],
        repeat=repeat,
        sine=tuple(sine.ravel().tolist()),
        cosine=tuple(cosine.ravel().tolist()),
    )
