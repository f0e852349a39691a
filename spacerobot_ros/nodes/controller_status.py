"""State of a controller on /diagnostics."""

from __future__ import annotations

import numpy as np

from ..control.adaptive.law_signals import Health
from ..control.command import Command
from ..control.loop import ControlLoop
from ..ros.diagnostics import ERROR, OK, STALE, WARN, Status
from .sensor_node import outliers


def input_status(loop: ControlLoop, joints_ns: int | None, age: float, reason: str) -> Status:
    """Whether the sensors arrive.

    Args:
        loop: The control loop.
        joints_ns: Stamp of the last joint states [ns]; None before the first.
        age: Their age [s].
        reason: Why the loop damps; empty where it does not.
    """
    if joints_ns is None:
        return Status('inputs', STALE, 'no joint states yet')
    values: dict[str, object] = {'age of joint states [s]': age}
    if loop.rate_ns is not None:
        values['gyro behind joint states [s]'] = (joints_ns - loop.rate_ns) * 1e-9
    if loop.attitude_ns is not None:
        values['attitude behind joint states [s]'] = (joints_ns - loop.attitude_ns) * 1e-9
    values |= outliers(loop.screen.left_out)
    if reason:
        return Status('inputs', ERROR, reason, values)
    return Status('inputs', OK, 'fresh', values)


def control_status(is_active: bool, command: Command | None, law: str, unit: str) -> Status:
    """What the loop is doing.

    Args:
        is_active: Whether it commands torques.
        command: The last one.
        law: Its name.
        unit: Of joint positions.
    """
    if not is_active:
        return Status('control', OK, 'inactive: no torque is commanded')
    if command is None:
        return Status('control', STALE, 'active, nothing to answer yet')
    values: dict[str, object] = {
        'law': law,
        f'largest joint error [{unit}]': float(np.abs(command.error).max(initial=0.0)),
        'saturated joints': int(np.count_nonzero(command.saturated)),
    }
    if command.attitude_error is not None:
        values['attitude error [rad]'] = float(np.linalg.norm(command.attitude_error))
    if command.mode == 'damping':
        free = '' if command.base is None else ', no torque on the base'
        return Status('control', WARN, f'damping to zero{free}: {command.reason}', values)
    if is_limited(command):
        return Status('control', WARN, f'{command.mode}, torque at its limit', values)
    return Status('control', OK, command.mode, values)


def estimate_status(loop: ControlLoop, note: str) -> Status:
    """What the law runs on."""
    if not loop.controller.takes_estimates:
        return Status('estimate', OK, 'not used by this law')
    is_used = loop.estimate is not None
    source = 'an estimate' if is_used else "the robot file's model"
    if loop.adaptive is not None:
        return Status('estimate', OK, f'started from {source}; {note}')
    return Status('estimate', OK if is_used else WARN, f'running on {source}; {note}')


def adaptation_status(health: Health, command: Command | None) -> Status:
    """State of the adaptation."""
    values: dict[str, object] = {
        'excitation': health.excitation,
        '(kappa + Lambda) x period': health.sampling,
        'base velocity': 'measured' if health.base_velocity_measured else 'from momentum',
    }
    if health.sampling_warning:
        return Status('adaptation', WARN, health.sampling_warning, values)
    if not health.physical:
        return Status('adaptation', WARN, 'parameters in force of no physical body', values)
    message = 'adapting' if health.adapting else f'not adapting: {health.reason}'
    limited = command is not None and is_limited(command)
    return Status('adaptation', WARN if limited else OK, message, values)


def is_limited(command: Command) -> bool:
    """Whether a limit cut a torque."""
    return bool(command.saturated.any()) or command.base_saturated
