"""State of a simulation on /diagnostics."""

from __future__ import annotations

from dataclasses import dataclass

from ..dynamics.ledger import MomentumLedger
from ..ros.diagnostics import ERROR, OK, WARN, Status

_KEPT = 1e-8  # relative momentum drift: far above round-off, far below what matters


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a simulation is.

    Args:
        is_lockstep: Whether it waits for commands.
        is_started: Whether step 0 is out.
        is_paused: Whether it is paused.
        step: Steps done.
        time_ns: Simulated time [ns].
        reached: Simulated time per wall time.
        late_ns: Stamp of a command that is overdue in lockstep [ns]; None where none is.
        is_fresh: Whether the joint command in force is fresh.
    """

    is_lockstep: bool
    is_started: bool
    is_paused: bool
    step: int
    time_ns: int
    reached: float
    late_ns: int | None
    is_fresh: bool


def time_status(progress: Progress, slips: int) -> Status:
    """Whether the simulation runs, and how fast; `slips` is how often it fell behind lately."""
    mode = 'lockstep' if progress.is_lockstep else 'real time'
    values: dict[str, object] = {'step': progress.step, 'time [s]': progress.time_ns * 1e-9}
    if not progress.is_started:
        return Status('time', WARN, f'{mode}: waiting for a controller', values)
    if progress.is_paused:
        return Status('time', OK, f'{mode}: paused', values)
    values['real-time factor'] = progress.reached
    if slips:
        values['fell behind [times]'] = slips
        return Status('time', WARN, f'{mode}: slower than real_time_factor asks for', values)
    return Status('time', OK, mode, values)


def command_status(progress: Progress) -> Status:
    """Whether commands arrive."""
    if progress.is_lockstep:
        if progress.late_ns is None:
            return Status('commands', OK, 'in step')
        values: dict[str, object] = {'awaited stamp [s]': progress.late_ns * 1e-9}
        return Status('commands', ERROR, 'no command for the last joint states', values)
    if progress.is_fresh:
        return Status('commands', OK, 'fresh')
    return Status('commands', WARN, 'none, or too old: joint torques are zero')


def momentum_status(ledger: MomentumLedger) -> Status:
    """Whether the plant keeps its momentum."""
    values: dict[str, object] = {
        'angular momentum drift, relative': ledger.momentum_drift,
        'energy drift [J]': ledger.energy_drift,
    }
    is_kept = ledger.momentum_drift < _KEPT
    message = 'kept' if is_kept else 'not kept: period or substeps are too coarse'
    return Status('momentum', OK if is_kept else WARN, message, values)
