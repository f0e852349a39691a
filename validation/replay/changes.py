"""What changed between two answers, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_WIDER = 1.5  # factor on a standard deviation that is said
_MISSES_MORE = 1.02  # factor on the rms error on another run that is said
_SLOWER, _NOTICED = 1.5, 5.0  # factor on the CPU time of one answer that is said; and [s]
Answer = Mapping[str, Any]


@dataclass(frozen=True)
class Change:
    """What is different in one answer.

    Args:
        key: Of the record.
        words: One phrase a difference.
        is_worse: Whether a right answer fell or a wrong one rose.
    """

    key: str
    words: tuple[str, ...]
    is_worse: bool

    def __str__(self) -> str:
        """One line."""
        return f'{self.key}: {"; ".join(self.words)}'


def changes(before: Mapping[str, Answer], after: Mapping[str, Answer]) -> list[Change]:
    """Of every record that both have answers to, what differs."""
    found = (_change(before[key], after[key]) for key in after if key in before)
    return [change for change in found if change.words]


def _change(old: Answer, new: Answer) -> Change:
    words = [*_verdict(old, new), *_names(old, new), *_values(old, new), *_cpu(old, new)]
    one, other = old.get('score'), new.get('score')
    is_worse = one != other and (one == 'right' or other == 'wrong')
    if one != other:
        words.insert(
            0, f'{"WORSE, " if is_worse else ""}{one or "no score"} -> {other or "no score"}'
        )
    return Change(str(new['key']), tuple(words), is_worse)


def _verdict(old: Answer, new: Answer) -> Iterator[str]:
    if old['verdict'] != new['verdict']:
        yield f'verdict {old["verdict"]} -> {new["verdict"]}'
    if old.get('reason', '') != new.get('reason', ''):
        yield f'reason is now "{new.get("reason", "")}"'
    for word, more, fewer in (('came', new, old), ('went', old, new)):
        for kind in ('findings', 'events', 'minor'):
            for found in more.get(kind, ()):
                if found not in fewer.get(kind, ()):
                    yield f'of {kind} {word}: {found}'


def _names(old: Answer, new: Answer) -> Iterator[str]:
    for word, more, fewer in (('came', new, old), ('went', old, new)):
        names = [name for name in more['names'] if name not in fewer['names']]
        if names:
            yield f'{word}: {", ".join(names)}'
    if old.get('rivals', {}) != new.get('rivals', {}):
        rivals = (f'{a} or {", ".join(b)}' for a, b in new.get('rivals', {}).items())
        yield f'not told apart: {"; ".join(rivals) or "nothing"}'


def _values(old: Answer, new: Answer) -> Iterator[str]:
    """Values that moved by more than the earlier deviation, deviations that grew or shrank."""
    for name, values in new['values'].items():
        for parameter, (value, std) in values.items():
            was, deviation = old['values'].get(name, {}).get(parameter, (None, None))
            if was is None or value is None or not deviation:
                continue
            moved = abs(value - was) / deviation
            if moved > 1.0:
                yield f'{parameter} of {name} {was:.4g} -> {value:.4g} ({moved:.1f} deviations)'
            if std and not 1.0 / _WIDER < std / deviation < _WIDER:
                yield f'deviation of {parameter} of {name} {deviation:.3g} -> {std:.3g}'
    was, is_now = (x.get('rms_of_another_run') for x in (old, new))
    if was and is_now and not 1.0 / _MISSES_MORE < is_now / was < _MISSES_MORE:
        yield f'the extended model misses {was:.4g} -> {is_now:.4g} of another run'


def _cpu(old: Answer, new: Answer) -> Iterator[str]:
    was, is_now = old['cpu_s'], new['cpu_s']
    ratio = is_now / max(was, 1e-3)
    if abs(is_now - was) > _NOTICED and not 1.0 / _SLOWER < ratio < _SLOWER:
        yield f'CPU {was:.0f} -> {is_now:.0f} s'


def summary(before: Mapping[str, Answer], after: Mapping[str, Answer]) -> list[str]:
    """Counts and CPU seconds of what both have answers to."""
    both = [key for key in after if key in before]
    out = [f'{len(both)} answers compared: {_counts([before[key] for key in both])}']
    out.append(f'now: {_counts([after[key] for key in both])}')
    new = [key for key in after if key not in before]
    if new:
        out.append(f'{len(new)} without a committed answer: {_counts([after[k] for k in new])}')
    return out


def _counts(answers: Sequence[Answer]) -> str:
    scores = Counter(a.get('score') or 'without a known truth' for a in answers)
    cpu = sum(a['cpu_s'] for a in answers)
    words = [f'{scores[s]} {s}' for s in ('right', 'wrong', 'silent', 'without a known truth')]
    return f'{", ".join(words)}; CPU {cpu:.0f} s'
