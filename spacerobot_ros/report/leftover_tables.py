"""What a leftover depends on, as lines for the terminal and a table for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import yaml

from ..diagnosis.answer.extended_model import effects_section
from ..diagnosis.answer.result import Diagnosis, Leftover, Order
from ..display import Item, Table
from ..formats import UNTESTED, estimate, percent, probability
from .sentences import SAID

_ONCE = 0.01  # of a turn: what a scale of the wheel's rate may be off by


def leftover_lines(diagnosis: Diagnosis) -> list[str]:
    """One line a channel of which something can be said."""
    laws = [_line(entry) for entry in diagnosis.leftover or () if _says_something(entry)]
    return [*laws, *(_order_line(order) for order in diagnosis.orders or ())]


def leftover_items(diagnosis: Diagnosis) -> Iterator[Item]:
    """For the page: a table, and the YAML entry of every law, to paste under `effects`."""
    if not diagnosis.leftover:
        return
    yield _table(diagnosis.leftover, SAID['leftover'])
    yield from (_order_line(order) for order in diagnosis.orders or ())
    for entry in diagnosis.leftover:
        if entry.applied is not None:
            section = effects_section([entry.applied])
            text = yaml.safe_dump(section, sort_keys=False, default_flow_style=True, width=1e9)
            yield (
                f'To keep the law of {entry.channel} in a robot file, under a name of yours, '
                f'paste under effects: {text.strip().removeprefix("{").removesuffix("}")}'
            )


def _table(leftover: Sequence[Leftover], caption: str) -> Table:
    rows = []
    for one in leftover:
        shares = one.held_out_gain, one.other_recording
        tested = ['' if share is None else percent(share, nothing=UNTESTED) for share in shares]
        p = '' if one.p_value is None else probability(one.p_value)
        law = ', '.join(one.depends_on), one.form or '', _coefficients(one)
        rows.append((one.channel, *law, one.resembles, p, *tested))
    head = 'channel', 'depends on', 'form', 'coefficients', 'resembles', 'p'
    return Table((*head, 'held out', 'other recording'), rows, caption)


def _order_line(order: Order) -> str:
    """A candidate of the catalogue, of a joint as an entry of a robot file."""
    periods = f'{order.order:.1f} periods a turn'
    if order.unit == 'N':
        periods = f'{order.order / (2.0 * math.pi):.1f} periods a metre'
    if order.channel:
        return _wheel_line(order)
    return (
        f'{order.joint}: its raw effort has a line at {periods} (p '
        f'{probability(order.p_value)}); as an entry of effects: ripple_{order.joint}: {{effect: '
        f'joint_torque_ripple, where: {order.joint}, amplitude: {order.amplitude:.3g}, harmonic: '
        f'{order.order:.1f}, phase: {order.phase:.3g}}}'
    )


def _wheel_line(order: Order) -> str:
    """A line that follows a wheel: once a turn it is what an imbalance makes."""
    what = 'no effect of the catalogue: bearings, the motor or the cage of a wheel make such lines'
    if abs(order.order - 1.0) < _ONCE:
        what = (
            'a candidate of wheel_imbalance at a steady rate, of rotor_imbalance where the wheel '
            'is a rotor of the robot file'
        )
    return (
        f'{order.joint}: {order.channel} has a line of {order.amplitude:.3g} {order.unit} at '
        f'{order.order:.3f} periods a turn of this wheel (p {probability(order.p_value)}): {what}'
    )


def _says_something(entry: Leftover) -> bool:
    return entry.form is not None or entry.p_value is not None or entry.one_speed


def _line(entry: Leftover) -> str:
    speed = ' (it moves at one speed only: see what to fly next)' if entry.one_speed else ''
    rivals = ''.join(f'; or {r.form} of {", ".join(r.depends_on)}' for r in entry.rivals)
    if entry.form is None:
        return f'{entry.channel}: {entry.resembles}{rivals}{speed}'
    learned = '' if entry.applied is None else f', in the extended model as {entry.applied.name}'
    return (
        f'{entry.channel}: {entry.resembles}: {entry.form} of {", ".join(entry.depends_on)} '
        f'({_coefficients(entry)}), explains {percent(entry.held_out_gain or 0.0)} of left-out '
        f'parts{learned}{rivals}{speed}'
    )


def _coefficients(entry: Leftover) -> str:
    return ', '.join(estimate(c.value, c.std, c.unit) for c in entry.coefficients)
