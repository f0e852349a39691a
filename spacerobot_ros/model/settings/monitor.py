"""The monitor."""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import param


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorSettings:
    """The monitor: how it watches the model in flight, and what it keeps of an event."""

    learn: float = param(
        8.0,
        unit='s',
        minimum=3.0,
        maximum=120.0,
        doc='First part of a run, which tells noise levels and how efforts act; judged after it.',
    )
    block: float = param(
        1.0,
        unit='s',
        minimum=0.2,
        maximum=10.0,
        doc='The model is judged once a block; an alarm comes at most this much later.',
    )
    false_alarm_interval: float = param(
        3.6e6,
        unit='s',
        minimum=3600.0,
        doc='Mean time between false alarms, at least; it sets the threshold of all tests.',
    )
    clear_after: float = param(
        5.0,
        unit='s',
        minimum=0.0,
        doc='An alarm ends when all tests have been below half the threshold for as long.',
    )
    whiteness_window: float = param(
        30.0,
        unit='s',
        minimum=5.0,
        maximum=600.0,
        doc='Length of the data in which lines and slow errors are searched.',
    )
    target_momentum: str = param(
        'estimated',
        choices=('estimated', 'believed'),
        doc='estimated: the captured wheels are unknown until /estimate or the flight tells; '
        'believed: as robot.target_wheels says.',
    )
    record_folder: str = param(
        '', doc='Folder of the bags around alarms; empty: nothing is recorded.'
    )
    pre_trigger: float = param(
        10.0, unit='s', minimum=0.0, maximum=300.0, doc='Recorded before an alarm.'
    )
    post_trigger: float = param(
        10.0, unit='s', minimum=0.0, maximum=3600.0, doc='Recorded after an alarm.'
    )
