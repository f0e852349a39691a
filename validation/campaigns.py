"""The harness of all campaigns: draw, simulate, ask, score, show; and which campaigns there are.

A campaign's entry is in `campaigns.yaml`, its tables are in `tables/NAME.yaml`. Its module has

- `trials(runs, is_quick)`: the keys of all trials; the longest first keeps all processes busy;
- `run(key)`: the record of a trial, plain JSON data without its key;
- `results(records)`: what the finished trials come to; not all need be there;
- `shown(results)`, where tables and figures to reach need more: the results with that;
- `judge(results)`, where figures to reach are no rows of a table: all of them, as `Check`;
- `drawings(records, results)`, where something is drawn.

A trial is its key, a text that holds all that it depends on, its seed too: its record is the same
in whatever order, on however many processes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from spacerobot_ros.batch.runner import Finished, Kept, Tasks, TrialRecord, complete
from spacerobot_ros.batch.workers import Workers
from spacerobot_ros.display import Section, Table
from spacerobot_ros.model.files import read_yaml

from .tables import Check as Check
from .tables import checks_of, tables_of

_T = TypeVar('_T')
_HERE = Workers()

Results = dict[str, Any]
"""What all records come to: plain data, as in the command's JSON."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """A campaign.

    Args:
        name: Of the sub-command, or of the campaign in it.
        help: What it does.
        module: Of this folder.
        title: Of the page. subtitle: One line below it.
        runs: Number of runs; what it means, the help of `--runs` says. quick_runs: With `--quick`.
        headlines: Pattern of the figures that the page shows first.
        is_kept: Whether records are kept, to go on where it stopped, and tables stand in a file
            beside the page.
        described: Name of the file of tables where it is another campaign's.
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
    described: str = ''
    alone: Sequence[str] = ()

    @property
    def file(self) -> str:
        """Where records are kept; empty: not."""
        return f'{self.name}.jsonl' if self.is_kept else ''

    @property
    def markdown(self) -> str:
        """File with all tables, where records are kept."""
        return f'{self.name}.md'

    def load(self) -> ModuleType:
        """The campaign's functions; imports what is heavy."""
        return import_module(f'.{self.module}', __package__)

    def tables(self, results: Results) -> list[Table]:
        """What is shown, in order."""
        return tables_of(self.described or self.name, self._shown(results))

    def judge(self, results: Results) -> list[Check]:
        """The figures to reach that could be computed."""
        if judge := getattr(self.load(), 'judge', None):
            return judge(results)
        return list(checks_of(self.described or self.name, self._shown(results)))

    def _shown(self, results: Results) -> Results:
        return getattr(self.load(), 'shown', lambda found: found)(results)

    def drawings(self, records: Sequence[TrialRecord], results: Results) -> list[Section]:
        """What is drawn, in order."""
        return getattr(self.load(), 'drawings', lambda *_: [])(records, results)


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
    tasks = Tasks(run=campaign.load().run, kept=kept, alone=tuple(campaign.alone))
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


CAMPAIGNS = {
    name: Campaign(name=name, **values)
    for name, values in read_yaml(Path(__file__).with_name('campaigns.yaml'), 'campaigns').items()
}
"""By name, as `campaigns.yaml` has them."""
