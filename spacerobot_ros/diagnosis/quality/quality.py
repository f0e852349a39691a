"""Whether a recording is worth anything: all that can be said of it before a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects.believed_friction import urdf_in_words
from ...effects.robot_file import RobotFile
from ...errors import SpaceRobotError
from ...estimation.noise_levels import DISAGREEMENT
from ...formats import counted
from ...identification.batch import identify
from ...json_values import json_as, json_fields
from ...recording.faults.data_faults import data_faults
from ...recording.record import Record
from ...sensing.sensor_faults import corrected_record
from .allan import Allan, allan
from .excited import Excited, excited, is_part
from .readings import ROUNDING, Reading, readings
from .sampling import (
    SPLINE,
    ClockDelay,
    RateScale,
    Sampling,
    delay_of,
    discrepancies,
    rate_scales,
    samplings,
    spline_integral,
)

_QUICK, _LONG = 14, 120.0  # joints and seconds that are identified within some seconds
_LOST = 0.01
"""Share of lost samples worth a word: as many as a filter of 100 samples' memory always holds."""
_SATURATED = 1e-3  # share of samples; fewer are a spike
_QUIETER = 3.0  # filtered before it was logged, or a data sheet that is too careful
_LATE = 3.0  # standard deviations that a delay is from none
_WALK = 2.0  # of the stated random walk
_SCALED = 0.02  # of a rate: a larger error of its scale is worth a word


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quality:
    """What a recording is worth.

    Args:
        source: The recording.
        sensors: How each sensor was sampled.
        delays: Of sensors that see the same motion.
        channels: What every column reads.
        allan: Of every rate whose integral another sensor measures.
        faults: By name; each makes a diagnosis refuse the recording.
        excitation: What the data tell of every unknown; None where it was not computed.
        why_not: Why it was not.
        notes: What the reader left out or assumed.
        findings: Everything above that should be looked at, a line each.
    """

    source: str
    sensors: tuple[Sampling, ...]
    delays: tuple[ClockDelay, ...]
    channels: tuple[Reading, ...]
    allan: tuple[Allan, ...]
    faults: tuple[str, ...]
    excitation: tuple[Excited, ...] | None
    why_not: str = json_as('excitation_not_computed')
    notes: tuple[str, ...]
    findings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        verdict = 'findings' if self.findings else 'good'
        why_not = self.why_not or None
        shown = json_fields(self) | {'excitation_not_computed': why_not}
        return {'schema': 1, 'verdict': verdict, **shown}


def check_record(record: Record, file: RobotFile | None = None) -> Quality:
    """Look at a recording.

    Args:
        record: As it was read.
        file: The robot's; without it what needs a model or stated noise is left out.
    """
    robot = None if file is None else file.robot
    faults = data_faults(record, robot)
    pairs = tuple(discrepancies(record, robot))
    late = (delay_of(pair) for pair in pairs)
    curves = (allan(pair.reference, pair.time, pair.left, pair.unit) for pair in pairs)
    excitation, why_not, notes = None, 'no robot file was given (--robot)', record.notes
    if file is not None:
        excitation, why_not = _excited(record, file, faults)
        said = urdf_in_words(file.robot, file.effects)
        notes = (*notes, *said, *_identified(record, file, faults))
    is_whole = file is None or excitation is None or not is_part(record, file.robot)
    if not is_whole:
        notes = (
            *notes,
            'so many joints: what the motion tells is that of a part of the recording',
        )
    sensors, channels = samplings(record), readings(record, robot)
    delays = tuple(one for one in late if one is not None)
    found = tuple(one for one in (*curves, _alone(record)) if one is not None)
    return Quality(
        source=record.source,
        sensors=sensors,
        delays=delays,
        channels=channels,
        allan=found,
        faults=faults,
        excitation=excitation,
        why_not=why_not,
        notes=notes,
        findings=(
            *(f'fault: {fault}' for fault in faults),
            *_of_sensors(sensors),
            *_of_delays(delays, channels),
            *_of_scales(rate_scales(record), channels),
            *_of_channels(channels),
            *_of_walks(found, file),
            *_of_excitation(excitation, robot.joints if robot is not None and is_whole else ()),
        ),
    )


def _alone(record: Record) -> Allan | None:
    """Of a gyro that no attitude is beside: its motion is in it."""
    if len(record.attitude_time) or len(record.rate_time) <= SPLINE:
        return None
    time, moved = record.rate_time, spline_integral(record.rate_time, record.omega)
    return allan('gyro, its motion included', time, moved)


def _excited(
    record: Record, file: RobotFile, faults: tuple[str, ...]
) -> tuple[tuple[Excited, ...] | None, str]:
    if faults:
        return None, 'the data are faulty'
    try:
        return excited(record, file), ''
    except SpaceRobotError as error:
        return None, str(error)


def _identified(record: Record, file: RobotFile, faults: tuple[str, ...]) -> Iterator[str]:
    """What `identify` says of the wheel momentum, where that is quick: it takes no other effect.

    The unknowns of `excitation` are the whole catalogue's; beside all of them less is known.
    """
    robot = file.believed
    if faults or not (robot.is_free and robot.joints and robot.target_wheels):
        return
    if record.joints is None or record.rates is None or record.attitudes is None:
        return
    if robot.n_joints > _QUICK or record.span[1] - record.span[0] > _LONG:
        return
    try:
        estimate = identify(
            corrected_record(record, file.robot, file.effects), robot, file.settings.identifier
        ).estimate
    except SpaceRobotError as error:
        yield f'identify: {error}'
        return
    std = float(np.max(estimate.std[: len(estimate.aam)]))
    verdict = 'valid' if estimate.valid else f'not valid: {estimate.reason}'
    yield f'identify: wheel momentum +- {std:.3g} N m s, where no other effect is; {verdict}'


def _of_sensors(sensors: tuple[Sampling, ...]) -> Iterator[str]:
    for one in sensors:
        if one.gaps:
            yield f'{one.sensor}: {counted(one.gaps, "gap")}, the longest {one.longest_gap:.3g} s'
        if one.lost > _LOST:
            yield f'{one.sensor}: {100.0 * one.lost:.3g} % of the samples at its rate are missing'


def _of_delays(delays: tuple[ClockDelay, ...], channels: tuple[Reading, ...]) -> Iterator[str]:
    """Delays that are clear of their spread, and make more than the noise of a reading."""
    for one in delays:
        noise = [c.noise for c in channels if c.channel.startswith(f'{one.late}/')]
        if abs(one.delay) > _LATE * one.std and one.error > max(noise, default=0.0):
            late, other = one.late, one.reference
            late, other = (late, other) if one.delay > 0.0 else (other, late)
            yield f'{late} is {abs(one.delay):.3g} +- {one.std:.1g} s later than {other}'


def _of_scales(scales: Iterator[RateScale], channels: tuple[Reading, ...]) -> Iterator[str]:
    """Rates of a clearly wrong scale, where that makes more than the noise of a position."""
    noise = {c.channel: c.noise for c in channels}
    for one in scales:
        off, least = abs(one.scale - 1.0), noise.get(f'joint_position/{one.joint}', 0.0)
        if off > max(_SCALED, _LATE * one.std) and one.error > least:
            times = f'{one.scale:.3g} +- {one.std:.1g} times'
            yield f'joint_velocity/{one.joint}: the positions go {times} as far as its integral'


def _of_channels(channels: tuple[Reading, ...]) -> Iterator[str]:
    for one in channels:
        if one.saturated > _SATURATED:
            share = f'{100.0 * one.saturated:.3g} %'
            yield f'{one.channel}: {share} of the samples stand at an end of its range'
        if one.stated is None:
            continue
        seen = f'{one.noise:.3g} {one.unit}, the robot file states {one.stated:.3g}'
        rounding = one.step / ROUNDING
        is_effort = one.channel.startswith('joint_effort')  # a controller makes it rough
        if one.noise > DISAGREEMENT * one.stated and not is_effort:
            yield f'{one.channel}: noise of {seen}'
        if one.noise < one.stated / _QUIETER:
            yield f'{one.channel}: noise of only {seen}: was it filtered?'
        if rounding > DISAGREEMENT * one.stated:
            yield f'{one.channel}: its steps of {one.step:.3g} are coarser than the stated noise'


def _of_walks(found: tuple[Allan, ...], file: RobotFile | None) -> Iterator[str]:
    stated = 0.0 if file is None else file.robot.sensors.gyro_bias_walk
    for one in found:
        if one.channel == 'gyro' and (one.random_walk or 0.0) > _WALK * stated:
            says = f', the robot file states {stated:.3g}' if file is not None else ''
            yield f'gyro: its bias walks by {one.random_walk:.3g} rad/s/sqrt(s){says}'


def _of_excitation(found: tuple[Excited, ...] | None, joints: tuple[str, ...]) -> Iterator[str]:
    """Joints of which the motion shows nothing at all."""
    seen = {one.where for one in found or () if one.status != 'not seen'}
    for joint in joints:
        if found is not None and joint not in seen:
            yield f'{joint}: the motion shows none of its effects'
