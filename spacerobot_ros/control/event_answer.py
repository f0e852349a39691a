"""How a controller answers what acts on the robot from outside (`monitor.on_event`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..types import Array
from .command import Torque
from .feedback import Feedback
from .reference_motion import ReferenceMotion

_HEARD_NS = 2_000_000_000  # for which what was said of an event counts; a monitor says it oftener

_EASING_NS = 250_000_000  # in which the torque before gives way to damping


class EventAnswer:
    """Damps or holds while something acts from outside.

    Args:
        kind: `report`: does neither.

    Attributes:
        words: What acts at the last sample; empty: nothing that is answered.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.forget()

    def forget(self) -> None:
        """Nothing acts."""
        self.words = self._heard = ''
        self._heard_ns: int | None = None
        self._offset: tuple[int, Array] | None = None

    def hear(self, words: str, stamp_ns: int | None) -> None:
        """Take what a monitor says; empty: it is over.

        Args:
            words: One line.
            stamp_ns: Stamp of the last joint sample [ns]; None before the first.
        """
        self._heard, self._heard_ns = words, stamp_ns

    def damps(self, stamp_ns: int) -> bool:
        """Whether the joints are to be damped at a sample; sets `words`."""
        if self._heard_ns is None:
            self._heard_ns = stamp_ns
        is_old = stamp_ns - self._heard_ns > _HEARD_NS
        self.words = '' if is_old or self._kind == 'report' else self._heard
        if not self.words:
            self._offset = None
        return bool(self.words) and self._kind == 'damp'

    def eased(self, torque: Torque, before: Array | None, stamp_ns: int) -> Torque:
        """Damping that is joined from the torque (n,) before it [N m]; None: at once."""
        if not self.words or before is None:
            return torque
        if self._offset is None:
            self._offset = stamp_ns, before - torque.tau
        start_ns, offset = self._offset
        rest = 1.0 - min((stamp_ns - start_ns) / _EASING_NS, 1.0)
        return replace(torque, tau=np.asarray(torque.tau + rest * offset))

    def follow(self, motion: ReferenceMotion, stamp_ns: int, sample: Feedback) -> bool:
        """Halt the motion for an event, go on with it afterwards; whether it is halted."""
        if self.words and not motion.is_halted:
            motion.halt(stamp_ns, sample)
        elif motion.is_halted and not self.words:
            motion.release(stamp_ns)
            motion.rejoin(stamp_ns, sample)
            return True
        return motion.is_halted
