"""Tables and drawings of the diagnosis campaign, from its scores."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from spacerobot_ros.display import Curve, Matrix, Panel, Plot, Section, Table, table_of

from ..campaigns import Results, TrialRecord
from ..shares import Share
from .diagnosis_score import Scores

_MOST_CHARACTERS = 160  # of a message
_NONE = Share(0, 0)


def tables(results: Results) -> list[Table]:
    """All scores, in the order of the page."""
    s = results['diagnosis']
    return [_outcomes(s), _shares(s), _found(s), _limits(s), _confusion(s), _refused(s), _times(s)]


def _outcomes(s: Scores) -> Table:
    rows = []
    for name, of in s['outcomes'].items():
        kind, multiple = name.split()
        rows.append([_words(kind), f'{float(multiple):g}', str(sum(of.values())), _counted(of)])
    return Table(
        ['hidden', 'x limit', 'records', 'outcome'],
        rows,
        'too weak and not simulated are no trials: bounds, the robot or the motion allow no more, '
        'or the controller is not stable under it; refused is never right; left out: the effect '
        'is not in the catalogue; equivalent: declared equivalents are named, no error',
        'What became of every record',
    )


def _words(name: str) -> str:
    return name.replace('_', ' ')


def _counted(of: Mapping[str, int]) -> str:
    return ', '.join(f'{_words(what)} {n}' for what, n in of.items())


def _shares(s: Scores) -> Table:
    rows = {
        'clean records with a name': 'clean_named',
        'clean records called unexplained': 'clean_unexplained',
        'clean records refused': 'clean_refused',
        'effect unknown: explained with a wrong name': 'left_out_wrong',
        'effect unknown: called consistent': 'left_out_missed',
        'values within 3 standard deviations': 'within',
        'rightly explained: held-out error within 5 % of the noise floor': 'held_out',
    }
    return Table(
        ['share', 'value (95 % interval)'],
        [[what, str(s[name])] for what, name in rows.items()],
        f'{s["without_std"]} values have no finite standard deviation and count as not within',
        'Shares',
    )


def _found(s: Scores) -> Table:
    named = {
        'all': 'top',
        'pairs, exactly': 'pairs',
        'triples, exactly': 'triples',
        'frequencies known to 0.3 % within 1 %': 'frequencies',
    }
    strengths = sorted({m for of in named.values() for m in s[of]})
    shares = {**{name: s[of] for name, of in named.items()}, **s['found']}
    return Table(
        ['effect', *(f'{m:g} x limit' for m in strengths)],
        [[name, *(str(by.get(m, _NONE)) for m in strengths)] for name, by in shares.items()],
        'share of records in which the first name is right, can not be told from the right one '
        'or is its declared equivalent, with its 95 % interval',
        'Found, by strength',
    )


def _limits(s: Scores) -> Table:
    return table_of(
        [{'effect': name, **limit} for name, limit in s['limits'].items()],
        'effect | parameter | median | least | most | matters from | unit | records',
        '{effect} | {parameter} | {median:.2g} | {least:.2g} | {most:.2g} | {relevant:.2g} | '
        '{unit} | {records}',
        'size at which twice the log likelihood grows by 30 on average, over robots, motions and '
        'places',
        'Detection limits',
    )


def _confusion(s: Scores) -> Table:
    rows = [
        [name, ', '.join(f'{outcome} {n}' for outcome, n in Counter(counts).most_common())]
        for name, counts in s['confusion'].items()
    ]
    caption = 'at three times the detection limit'
    return Table(['hidden', 'named'], rows, caption, 'Who is taken for whom')


def _refused(s: Scores) -> Table:
    counted: Counter[tuple[str, str, str]] = Counter(s['refused'])
    rows = [
        [_words(kind), names or 'nothing', str(n), message[:_MOST_CHARACTERS]]
        for (kind, names, message), n in counted.most_common()
    ]
    head = ['kind', 'hidden', 'records', 'message']
    return Table(head, rows, title='Refused, and not simulated')


def _times(s: Scores) -> Table:
    cells = [f'{value:.1f}' for value in s['wall']]
    return Table(['median [s]', 'longest [s]'], [cells], title='Time of a diagnosis')


def drawings(records: Sequence[TrialRecord], results: Results) -> list[Section]:
    """False alarms against detection, and who is taken for whom."""
    s = results['diagnosis']
    alarms = np.asarray(s['roc']['false_alarm'])
    curves = [
        Curve(f'{name.removeprefix("found_")} x limit', alarms, np.asarray(shares))
        for name, shares in s['roc'].items()
        if name.startswith('found_')
    ]
    what = 'share of effects whose evidence is above the threshold'
    plots = [
        Plot(
            [Panel(what, '1', curves)],
            'The threshold on the best evidence falls from left to right.',
            'share of clean records above it',
        )
    ]
    if s['confusion']:
        caption = 'Who is taken for whom, at three times the detection limit.'
        plots.append(Plot(_matrix(s['confusion']), caption))
    return [Section('Detection and confusion', plots)]


def _matrix(confusion: Mapping[str, Mapping[str, int]]) -> Matrix:
    """Hidden effects against all that was named, verdicts without a name last."""
    hidden = list(confusion)
    others = sorted({name for counts in confusion.values() for name in counts} - set(hidden))
    columns = [*hidden, *others]
    counts = np.array([[of.get(c, 0) for c in columns] for of in confusion.values()])
    return Matrix(hidden, columns, counts, 'named first')
