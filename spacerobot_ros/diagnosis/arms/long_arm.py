"""An arm's record that is too long for memory: rows made stretch by stretch, summed, dropped."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

from ...effects.effect import Effect
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance, balance_of, rms
from ...estimation.balance.row_blocks import CLUSTERS_AT_MOST
from ...estimation.rows import ChannelError
from ...estimation.stretches import SHOWN, joined, thinned
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..events.arm_events import arm_events
from ..events.event import Events, Spans


@dataclass(frozen=True, eq=False)
class Stretches:
    """All of a record, by time.

    Args:
        records: Its stretches.
        robot: The robot file's robot.
        left_out: By stretch, times in which something acts from outside.
    """

    records: tuple[Record, ...]
    robot: Robot
    left_out: tuple[Spans, ...]

    @classmethod
    def of(cls, records: Sequence[Record], robot: Robot) -> Stretches:
        """With no time left out."""
        return cls(tuple(records), robot, ((),) * len(records))

    @property
    def blocks_of_each(self) -> int:
        """Most blocks of rows of a stretch."""
        return max(1, CLUSTERS_AT_MOST // len(self.records))

    def balances(self, effects: Sequence[Effect]) -> Iterator[Balance]:
        """Under a robot with effects, one after another."""
        for record, spans in zip(self.records, self.left_out, strict=True):
            yield balance_of(record, self.robot, effects, spans)

    def with_events(
        self, believed: Sequence[Effect], rows: ArmRows | None
    ) -> tuple[Stretches, Events]:
        """Without the times of events, and these.

        Args:
            believed: The robot file's own effects.
            rows: Of a sample; None where no joint moves.
        """
        found = []
        for balance in self.balances(believed):
            own = rows.along([balance]) if rows and balance.arm.is_moving.any() else None
            found.append(arm_events([balance], own))
        events = reduce(Events.with_more, (own.events for own in found))
        events = replace(events, notes=tuple(dict.fromkeys(events.notes)))
        return replace(self, left_out=tuple(own.left_out[0] for own in found)), events

    def rows(
        self,
        sample: ArmRows,
        believed: Sequence[Effect],
        about: Callable[[ArmRows, Sequence[Record], Sequence[Spans]], ArmRows],
    ) -> Iterator[ArmRows]:
        """Of every stretch in which a joint moves.

        Args:
            sample: Rows of some stretches, with the candidates.
            believed: The robot file's own effects.
            about: Linearizes rows of records without some times.
        """
        pairs = zip(self.records, self.left_out, strict=True)
        for balance, (record, spans) in zip(self.balances(believed), pairs, strict=True):
            if balance.arm.is_moving.any():
                yield about(sample.along([balance]), [record], [spans])


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """What a model leaves along recordings.

    Args:
        rms: (n,) where joints move; NaN of one that never does [N m].
        channels: The same along the first recording, or a long one.
    """

    rms: Array
    channels: tuple[ChannelError, ...]

    @classmethod
    def of(cls, balances: Sequence[Balance]) -> Traces:
        """Of recordings."""
        return cls(rms(balances), balances[0].channels())

    @classmethod
    def along(cls, stretches: Stretches, effects: Sequence[Effect]) -> Traces:
        """Of a model with effects along a long record, every few samples of it."""
        shown = list[list[ChannelError]]()

        def traced() -> Iterator[Balance]:
            for balance in stretches.balances(effects):
                most = SHOWN // len(stretches.records)
                shown.append([thinned(channel, most) for channel in balance.channels()])
                yield balance

        whole = rms(traced())
        return cls(whole, tuple(map(joined, zip(*shown, strict=True))))
