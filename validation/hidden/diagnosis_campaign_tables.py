"""Tables and drawings of the diagnosis campaign, from its scores."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from spacerobot_ros.display import Curve, Matrix, Panel, Plot, Section

from ..campaigns import Results, TrialRecord
from ..shares import Share

_LONGEST = 160  # characters of a message
_NONE = Share(0, 0)
_SHARES = {
    'clean records with a name': 'clean_named',
    'clean records called unexplained': 'clean_unexplained',
    'clean records refused': 'clean_refused',
    'effect unknown: explained with a wrong name': 'left_out_wrong',
    'effect unknown: called consistent': 'left_out_missed',
    'values within 3 standard deviations': 'within',
    'rightly explained: held-out error within 5 % of the noise floor': 'held_out',
}
_NAMED = {
    'all': 'top',
    'pairs, exactly': 'pairs',
    'triples, exactly': 'triples',
    'frequencies known to 0.3 % within 1 %': 'frequencies',
}


def shown(results: Results) -> Results:
    """With rows of the tables."""
    s = results['diagnosis']
    outcomes = [(*name.split(), of) for name, of in s['outcomes'].items()]
    named = {name: s[of] for name, of in _NAMED.items()} | s['found']
    strengths = sorted({m for of in _NAMED.values() for m in s[of]})
    refused = Counter(s['refused']).most_common()
    return {
        **results,
        'outcomes': [
            {'kind': kind, 'multiple': float(m), 'records': sum(of.values()), 'outcomes': of}
            for kind, m, of in outcomes
        ],
        'shares': {what: s[name] for what, name in _SHARES.items()},
        'found': [
            {'effect': e, 'cells': {f'{m:g} x limit': by.get(m, _NONE) for m in strengths}}
            for e, by in named.items()
        ],
        'confusion': {
            name: ', '.join(f'{as_} {n}' for as_, n in Counter(counts).most_common())
            for name, counts in s['confusion'].items()
        },
        'refused': [
            {'kind': kind, 'names': names or 'nothing', 'records': n, 'message': why[:_LONGEST]}
            for (kind, names, why), n in refused
        ],
    }


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
