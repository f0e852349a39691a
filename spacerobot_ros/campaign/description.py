"""What a campaign is, and which there are: light enough for the command's help.

A campaign draws trials, runs each to a plain JSON record, judges all records and shows them as
tables and drawings. A trial is its key, a text that holds all that it depends on, its seed too:
its record is the same in whatever order, on however many processes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from operator import itemgetter
from typing import Any, Protocol, TypeVar, cast

from ..display import Section, Table

_T = TypeVar('_T')

Record = dict[str, Any]
"""Plain JSON data of one trial, its key as `case`."""
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

    def run(self, key: str) -> Record:
        """The record of a trial, without its key."""

    def results(self, records: Sequence[Record]) -> Results:
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
        key_of: The key of a record that was kept.
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
    key_of: Callable[[Record], str] = itemgetter('case')

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

    def drawings(self, records: Sequence[Record], results: Results) -> list[Section]:
        """What is drawn, in order; a module that draws has a function of this name."""
        draw = getattr(self.load(), 'drawings', None)
        return draw(records, results) if draw else []


def key(*parts: Any) -> str:
    """The key of a trial from its parts, plain JSON values."""
    return json.dumps(parts)


def grouped(records: Iterable[_T], of: Callable[[_T], Any]) -> dict[Any, list[_T]]:
    """Records that have the same of something, in the order of their first ones."""
    out: dict[Any, list[_T]] = {}
    for record in records:
        out.setdefault(of(record), []).append(record)
    return out


def kinds(records: Iterable[Record]) -> dict[str, list[Record]]:
    """Records by the first part of their key."""
    return grouped(records, lambda record: json.loads(record['case'])[0])


def without(record: Record, *names: str) -> Record:
    """A record without some of its entries."""
    return {name: value for name, value in record.items() if name not in names}


def _coverage_key(record: Record) -> str:
    return key('coverage', record['axes'], record['seed']) if record['methods'] else ''


WHEEL_MOMENTUM = Campaign(
    name='wheel-momentum',
    help="""\
momentum-based identification of the captured wheels (docs/reproduction.md):
minimal sets, condition numbers, Table III without and with noise, estimators against the
Cramer-Rao bound, tracking with and without knowledge of the wheels (Figs 4-7), on the correct
plant and on the one that the paper's equations describe""",
    module='wheel_experiments',
    title='Wheel-momentum identification, reproduced',
    subtitle='Robot of Table I, motion of Table II; seeded, joint axes named by their letters',
    runs=10,
    quick_runs=2,
    headlines='^condition.*symmetric moving|zyx, no_aam, correct',
)
COVERAGE = Campaign(
    name='coverage',
    help='wheel-momentum: do 95 % intervals hold in many runs?',
    module='coverage',
    title='Coverage of the stated standard deviations',
    subtitle='Seeded noisy records of the motion of Table II, wrong inertial parameters',
    runs=200,
    quick_runs=12,
    headlines='covered',
    is_kept=True,
    key_of=_coverage_key,
)
ADAPTIVE_CONTROL = Campaign(
    name='adaptive-control',
    help="""\
adaptive control of base attitude and joints (docs/adaptive.md), on a robot of
our own, since the paper's is not published: set-points with wrong parameters, Lambda sweep,
harmonic tracking with all laws, inertia histories, noise, sampling limit, time of a cycle""",
    module='adaptive_control',
    title='Adaptive control of a mini space robot, reproduced',
    subtitle="Our own robot (config/minisat.yaml): the paper's Table 1 is not published as text; "
    'seeded',
    runs=6,
    quick_runs=2,
    headlines='adaptive_rls.*worst of|^(noise|cycle|Lyapunov)',
    alone=('["cycle"',),
)
DIAGNOSIS = Campaign(
    name='diagnosis',
    help="""\
hidden effects found and named (docs/diagnosis.md): clean records, every effect at
several strengths, pairs, triples, effects taken out of the catalogue; confusion, detection, false
alarms. A night's work; --quick takes minutes""",
    module='diagnosis_campaign',
    title='Diagnosis: hidden effects, found and named',
    subtitle="Seeded records of the project's own plant",
    runs=600,
    quick_runs=6,
    is_kept=True,
)
MONITOR = Campaign(
    name='monitor',
    help="""\
false alarms in nominal flight and delays of detection of the monitor node
(docs/nodes/monitor.md): quarter hours without a fault, and faults of several sizes that set in""",
    module='monitor_campaign',
    title='Monitor: false alarms, and delays of detection',
    subtitle='Seeded flights in closed loop, random motions, noise of the robot files',
    runs=4,
    quick_runs=2,
    headlines='^alarms',
    is_kept=True,
)
ARMS = Campaign(
    name='arms',
    help="""\
causes named on arms whose noise nobody knows (docs/real_machines.md): simulated
ones with a coloured leftover, as they should be and with one cause, alone and compared""",
    module='arm_campaign',
    title='Arms whose noise nobody knows: causes and changes, found and named',
    subtitle='Seeded machines with a coloured leftover, torques by Pinocchio',
    runs=300,
    quick_runs=14,
    headlines='name',
    is_kept=True,
)
DISCOVERY = Campaign(
    name='discovery',
    help="""\
laws that no catalogue knows, hidden in simulated arms (docs/discovery.md): inside
and outside the grammar, at three times and once the noise, in noise of five colours; and machines
without any""",
    module='discovery_campaign',
    title='What no catalogue knows: laws hidden and found',
    subtitle='Seeded machines, torques by Pinocchio, noise of five colours',
    runs=6,
    quick_runs=1,
    headlines='variables|discovery',
    is_kept=True,
)
EVENTS = Campaign(
    name='events',
    help="""\
pulses hidden in arms that move and that stand, in free bases with unknown wheels and in bodies
without joints (docs/events.md): which are named, when and how large; what is named in quiet""",
    module='event_campaign',
    title='Events: pulses hidden and named, and what is named in quiet',
    subtitle='Seeded machines, what is left of arms in five colours',
    runs=20,
    quick_runs=2,
    headlines='false events',
    is_kept=True,
)
FAULTS = Campaign(
    name='faults',
    help="""\
odd messages, floods of them, streams that go astray, damaged bags, malformed files, processes that
are killed (docs/faults.md): what ends a node, what passes for data. Needs ROS 2""",
    module='.nodes.fault_campaign',
    title='Faults: what ends a node, and what passes for data',
    subtitle='Seeded; the servicer, all nodes',
    runs=20,
    quick_runs=1,
    headlines='raised',
    alone=('["kills"', '["starved"', '["floods"'),
    is_kept=True,
)
EXPERIMENTS = {
    c.name: c
    for c in (
        WHEEL_MOMENTUM,
        ADAPTIVE_CONTROL,
        DIAGNOSIS,
        MONITOR,
        ARMS,
        DISCOVERY,
        EVENTS,
        FAULTS,
    )
}
"""By the name of the sub-command; coverage is a campaign of the first."""
