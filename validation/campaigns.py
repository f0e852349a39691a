"""What a campaign is, and which there are.

A campaign draws trials, runs each to a plain JSON record, judges all records and shows them as
tables and drawings. A trial is its key, a text that holds all that it depends on, its seed too:
its record is the same in whatever order, on however many processes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

from spacerobot_ros.batch.runner import Finished, Kept, Tasks, TrialRecord, complete
from spacerobot_ros.batch.workers import Workers
from spacerobot_ros.display import Section, Table
from spacerobot_ros.model.files import read_yaml

_T = TypeVar('_T')
_HERE = Workers()

Results = dict[str, Any]
"""What all records come to: plain data, as in the command's JSON."""


@dataclass(frozen=True, slots=True)
class Check:
    """A figure to reach.

    Args:
        what: The figure.
        value: Reached.
        low: Smallest good value. high: Largest good value.
        unit: Of them.
    """

    what: str
    value: float
    low: float
    high: float
    unit: str = ''

    @property
    def is_met(self) -> bool:
        """Whether the value is within its limits."""
        return self.low <= self.value <= self.high

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        return {**asdict(self), 'is_met': self.is_met}


class Experiment(Protocol):
    """What a campaign's module has."""

    def trials(self, runs: int, is_quick: bool) -> list[str]:
        """Keys of all trials; the longest first keeps all processes busy to the end."""

    def run(self, key: str) -> TrialRecord:
        """The record of a trial, without its key."""

    def results(self, records: Sequence[TrialRecord]) -> Results:
        """What the finished trials come to; not all need be there."""

    def judge(self, results: Results) -> list[Check]:
        """The figures to reach that could be computed."""

    def tables(self, results: Results) -> list[Table]:
        """What is shown, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """A campaign.

    Args:
        name: Of the sub-command, or of the campaign in it.
        help: What it does.
        module: Of this folder, or `.ROOM.NAME` where it needs ROS: an `Experiment`.
        title: Of the page. subtitle: One line below it.
        runs: Number of runs; what it means, the help of `--runs` says. quick_runs: With `--quick`.
        headlines: Pattern of the figures that the page shows first.
        is_kept: Whether records are kept, to go on where it stopped, and tables stand in a file
            beside the page.
        alone: Beginnings of keys that are run before other processes compete.
    """

    name: str
    help: str
    module: str
    title: str
    subtitle: str
    runs: int
    quick_runs: int
    headlines: str = ''
    is_kept: bool = False
    alone: tuple[str, ...] = ()

    @property
    def file(self) -> str:
        """Where records are kept; empty: not."""
        return f'{self.name}.jsonl' if self.is_kept else ''

    @property
    def markdown(self) -> str:
        """File with all tables; empty: none."""
        return f'{self.name}.md' if self.is_kept else ''

    def load(self) -> Experiment:
        """The campaign's functions; imports what is heavy."""
        return cast(Experiment, import_module(f'.{self.module}', __package__))

    def drawings(self, records: Sequence[TrialRecord], results: Results) -> list[Section]:
        """What is drawn, in order; a module that draws has a function of this name."""
        draw = getattr(self.load(), 'drawings', None)
        return draw(records, results) if draw else []


def finish(
    campaign: Campaign,
    keys: Sequence[str],
    folder: Path,
    workers: Workers = _HERE,
    done: Callable[[float], None] = lambda _: None,
    minutes: float = math.inf,
) -> Finished:
    """Run the trials of a campaign that a folder lacks; the folder exists, else as `complete`."""
    kept = Kept(folder / campaign.file if campaign.file else None)
    tasks = Tasks(run=campaign.load().run, kept=kept, alone=campaign.alone)
    return complete(tasks, keys, workers, done, minutes)


def key(*parts: Any) -> str:
    """The key of a trial from its parts, plain JSON values."""
    return json.dumps(parts)


def grouped(records: Iterable[_T], of: Callable[[_T], Any]) -> dict[Any, list[_T]]:
    """Records that have the same of something, in the order of their first ones."""
    out: dict[Any, list[_T]] = {}
    for record in records:
        out.setdefault(of(record), []).append(record)
    return out


def kinds(records: Iterable[TrialRecord]) -> dict[str, list[TrialRecord]]:
    """Records by the first part of their key."""
    return grouped(records, lambda record: json.loads(record['case'])[0])


def without(record: TrialRecord, *names: str) -> TrialRecord:
    """A record without some of its entries."""
    return {name: value for name, value in record.items() if name not in names}


def _described(name: str, values: dict[str, Any]) -> Campaign:
    return Campaign(name=name, **{**values, 'alone': tuple(values.get('alone', ()))})


CAMPAIGNS = {
    name: _described(name, values)
    for name, values in read_yaml(Path(__file__).with_name('campaigns.yaml'), 'campaigns').items()
}
"""By name, as `campaigns.yaml` has them."""
