"""Tables of the diagnosis campaign."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from ..campaign.diagnosis_score import Scores
from ..campaign.shares import Share
from ..display import Table

_MOST_CHARACTERS = 160  # of a message
_NONE = Share(0, 0)


def tables(s: Scores) -> list[tuple[str, Table]]:
    """Title and table, in the order of the page."""
    return [
        ('What became of every record', _outcomes(s)),
        ('Shares', _shares(s)),
        ('Found, by strength', _found(s)),
        ('Detection limits', _limits(s)),
        ('Who is taken for whom', _confusion(s)),
        ('Refused, and not simulated', _refused(s)),
        ('Time of a diagnosis', _times(s)),
    ]


def _outcomes(s: Scores) -> Table:
    rows = [
        [kind.replace('_', ' '), f'{multiple:g}', str(sum(of.values())), _counted(of)]
        for (kind, multiple), of in s.outcomes.items()
    ]
    return Table(
        ['hidden', 'x limit', 'records', 'outcome'],
        rows,
        'too weak and not simulated are no trials: bounds, the robot or the motion allow no more, '
        'or the controller is not stable under it; refused is never right; left out: the effect '
        'is not in the catalogue, equivalent: only declared equivalents are named',
    )


def _counted(of: Mapping[str, int]) -> str:
    return ', '.join(f'{what.replace("_", " ")} {n}' for what, n in of.items())


def _shares(s: Scores) -> Table:
    rows = [
        ['clean records with a name', s.clean_named],
        ['clean records called unexplained', s.clean_unexplained],
        ['clean records refused', s.clean_refused],
        ['effect unknown: explained with a wrong name', s.left_out_wrong],
        ['effect unknown: called consistent', s.left_out_missed],
        ['values within 3 standard deviations', s.within],
        ['rightly explained: held-out error within 5 % of the noise floor', s.held_out],
    ]
    return Table(
        ['share', 'value (95 % interval)'],
        [[str(what), str(share)] for what, share in rows],
        f'{s.without_std} values have no finite standard deviation and count as not within',
    )


def _found(s: Scores) -> Table:
    strengths = sorted({*s.top, *s.pairs})
    named = {'all': s.top, 'pairs, exactly': s.pairs, 'frequencies within 1 %': s.frequencies}
    rows = [
        [name, *(str(by.get(m, _NONE)) for m in strengths)]
        for name, by in [*named.items(), *s.found.items()]
    ]
    return Table(
        ['effect', *(f'{m:g} x limit' for m in strengths)],
        rows,
        'share of records in which the first name is right, or can not be told from the right '
        'one, with its 95 % interval',
    )


def _limits(s: Scores) -> Table:
    rows = [
        [
            name,
            limit.parameter,
            f'{limit.median:.2g}',
            f'{limit.least:.2g}',
            f'{limit.most:.2g}',
            f'{limit.relevant:.2g}',
            limit.unit,
            str(limit.records),
        ]
        for name, limit in s.limits.items()
    ]
    return Table(
        ['effect', 'parameter', 'median', 'least', 'most', 'matters from', 'unit', 'records'],
        rows,
        'size at which twice the log likelihood grows by 30 on average, over robots, motions and '
        'places',
    )


def _confusion(s: Scores) -> Table:
    rows = [
        [name, ', '.join(f'{said} {n}' for said, n in sorted(counts.items(), key=lambda x: -x[1]))]
        for name, counts in s.confusion.items()
    ]
    return Table(['hidden', 'named'], rows, 'at three times the detection limit')


def _refused(s: Scores) -> Table:
    counted = Counter(s.refused).most_common()
    rows = [
        [kind.replace('_', ' '), names or 'nothing', str(n), message[:_MOST_CHARACTERS]]
        for (kind, names, message), n in counted
    ]
    return Table(['kind', 'hidden', 'records', 'message'], rows, '')


def _times(s: Scores) -> Table:
    return Table(['median [s]', 'longest [s]'], [[f'{value:.1f}' for value in s.wall]], '')
