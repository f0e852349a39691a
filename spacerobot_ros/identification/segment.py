"""One run of samples without breaks, in bounded memory: what it tells of the robot.

New samples continue the square-root information. While the whole segment fits into the buffer it
is run through again each time its length has doubled, about the better constants; later stretches
are linearized about constants that no longer move.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.trajectory.reference import NoiseLevels
from ..estimation.unknowns.torque_hold import Holds, find_holds
from ..model.settings import IdentifierSettings
from ..recording.buffer import SampleBuffer
from ..recording.faults.motion_faults import contradictions
from ..recording.record import Record
from . import validity_limits as limits
from .maximum_likelihood import Known, MaximumLikelihood, prepare
from .outliers import common_time, without_outliers
from .summary import Source, unexplained

_LARGEST = 20_000
"""Samples of one sensor in one solution: it takes 36 kB of memory for each (servicer)."""
_COST = 32_000_000
"""Samples of one sensor times squared unknowns in one solution: some 0.5 s of CPU a pass, so that
estimates of seven joints stay a second apart; 40 s of them, 12 s of fourteen joints."""
Screened = tuple[Record, Callable[..., Counter[str]]]
"""A record without outliers, and what counts them between two times [s]."""


class Past(NamedTuple):
    """Segments before one.

    Args:
        source: What they came from.
        left_out: Samples that were left out of them, by sensor.
        contradicted: Stretches in a row, right before, that contradict what was learned.
    """

    source: Source
    left_out: Counter[str]
    contradicted: int


class Segment:
    """What is known at its beginning, and what its samples add.

    Args:
        model: Of the robot.
        settings: The identifier's settings.
        samples: Where samples are collected.
        start: Samples up to then are of other segments [s].
        known: What is known of the constants at its beginning.
        past: Segments before this one.

    Attributes:
        likelihood: The constants.
        done: Up to when samples are used [s].
        source: What the constants came from, segments before this one included.
        left_out: Samples that contradict their neighbours, by sensor, those before included;
            never changed in place.
        contradicted: Stretches in a row that contradict what was learned, and were not used.
    """

    def __init__(
        self,
        model: MomentumModel,
        settings: IdentifierSettings,
        samples: SampleBuffer,
        start: float,
        known: Known | None,
        past: Past,
    ) -> None:
        self._model, self._settings, self._samples = model, settings, samples
        self.start, self.done = start, max(start, 0.0)
        self.likelihood = MaximumLikelihood(model, settings, known)
        self._past = past
        self.source, self.left_out, self.contradicted = past
        self._used = 0.0, 0  # squares and rows of what was accepted
        self._least = limits.FIRST if known is None else limits.SHORTEST
        self._noise: NoiseLevels | None = None
        self._first_joints: float | None = None  # from which holds count
        self._is_kept, self._next_rerun = True, 0.0
        self._rerun_constants = model.prior()

    def lacking(self, record: Record, end: float) -> str:
        """Why a record does not suffice up to a time [s], empty where it does."""
        seconds = common_time(record, end)
        if end - self.done < 1e-3 or (self._noise is None and seconds < self._least):
            return f'only {max(seconds, 0.0):.1f} s of data yet, {self._least:g} s are needed'
        return ''

    def longest(self, record: Record) -> float:
        """Up to when samples of joints and gyro are few enough for one solution [s]."""
        ends = [np.inf]
        for time in (record.joint_time, record.rate_time):
            last = int(np.searchsorted(time, self.done)) + _LARGEST
            if last < len(time):
                ends.append(float(time[last]))
        return min(ends)

    def screened(self, record: Record) -> Screened:
        """A record without outliers."""
        noise = self._noise
        if noise is None:
            noise, _ = noise_levels(self._model.robot.sensors, record, is_checked=False)
        kept, found = without_outliers(record, noise)
        return kept, partial(found.counted, record)

    def learn(self, record: Record, end: float, newest: Screened) -> str:
        """Run through what is new up to a time [s]; why it does not fit, empty where it does."""
        if self._noise is not None and not (self._is_whole(end) and self._is_rerun_due(end)):
            self._run_new(record, end, *newest)
            if suspicion := self._suspicion():
                return suspicion
            doubt = self._misfit_beyond(*self._used)
            if not (doubt and self._is_whole(end)):
                return doubt  # otherwise it may be linearized too far away
        self._run_all(record, end)
        # about constants that have not settled, what old and new data leave moves between them
        used = self._used if self.likelihood.is_converged else (0.0, 0)
        return '; '.join(self.source.faults) or self._misfit_beyond(*used)

    def accept(self) -> None:
        """Judge what comes by what was learned up to now."""
        self._used, self.contradicted = self.likelihood.misfit, 0

    def _misfit_beyond(self, squares: float, rows: int, limit: float = limits.LARGEST_CHI2) -> str:
        """What to say where rows beyond some, and their squares, can't be of the same model.

        By what they add: a long run before them must not hide them.
        """
        all_squares, all_rows = self.likelihood.misfit
        chi2 = (all_squares - squares) / max(1, all_rows - rows)
        return '' if chi2 <= limit else unexplained(chi2)

    def _suspicion(self) -> str:
        """What to say of a stretch that is clearly worse than those before.

        A single one is left out; where the next is, too, noise may have grown.
        """
        squares, rows = self._used
        if not rows or self.contradicted:
            return ''
        new = max(1, self.likelihood.misfit[1] - rows)
        limit = max(limits.SUSPICIOUS, 1.0 + limits.SUSPICIOUS_SCATTER * (2.0 / new) ** 0.5)
        return self._misfit_beyond(squares, rows, limit * squares / rows)

    def is_kept_up_to(self, end: float) -> bool:
        """Whether all its samples up to a time [s] are worth keeping; once not, never again."""
        self._is_kept = self._is_whole(end)
        return self._is_kept

    def _run_all(self, record: Record, end: float) -> None:
        used = record.between(-np.inf, end)
        self._noise, notes = noise_levels(self._model.robot.sensors, used, is_checked=False)
        record, count = self.screened(record)  # what comes later tells what the last samples are
        faults, record = contradictions(record), record.between(-np.inf, end)
        stretch = prepare(record, self._noise, self._holds(record))
        self.likelihood.solve(stretch)
        self._rerun_constants = self.likelihood.posterior().mean
        samples = self._past.source.samples + len(record.joint_time)
        self.source = Source(samples, 0, notes, faults)
        self.left_out = self._past.left_out + count(until=end)
        self.done = float(stretch.reference.times[-1])
        begun = max(self.start, 0.0)
        self._next_rerun = begun + 2.0 * (end - begun)

    def _run_new(
        self, record: Record, end: float, context: Record, count: Callable[..., Counter[str]]
    ) -> None:
        new = context.between(self.done, end)
        if self._noise is None or not (len(new.joint_time) or len(new.rate_time)):
            return
        self.left_out = self.left_out + count(self.done, end)
        stretch = self.likelihood.extend(new, context, self._noise, self._holds(record))
        samples = self.source.samples + len(new.joint_time)
        self.source = replace(self.source, samples=samples)
        self.done = float(stretch.reference.times[-1])

    def _is_whole(self, end: float) -> bool:
        """Whether the buffer holds the whole segment up to a time [s], few enough to run again."""
        most = min(_LARGEST, _COST // self._model.filter_size**2)
        few = all(len(s.stamps) <= most for s in self._samples.streams.values())
        return self._is_kept and few and end - max(self.start, 0.0) <= self._settings.buffer

    def _is_rerun_due(self, end: float) -> bool:
        """Whether the linearization of what was run through is no longer good enough."""
        if not self.likelihood.is_converged or end >= self._next_rerun:
            return True
        posterior = self.likelihood.posterior()
        moved = np.abs(posterior.mean - self._rerun_constants)
        return bool(np.any(moved > limits.MOVED * np.sqrt(np.diag(posterior.covariance))))

    def _holds(self, record: Record) -> Holds:
        if self._first_joints is None:
            self._first_joints = float(record.joint_time[0])
        return find_holds(record, self._settings.torque_hold_period, self._first_joints)
