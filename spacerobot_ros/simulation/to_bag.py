"""Records a simulated run in a bag, on the topics of the nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..control.loop import Command
from ..recording.bag_writer import BagWriter
from .closed_loop import ClosedLoop, Step
from .plant import THRUSTERS
from .sample_messages import sample_messages

LEDGER_PERIOD = 0.1  # s


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Key figures of a run.

    Args:
        steps: Control periods.
        duration: Simulated time [s].
        messages: Messages in the bag.
        max_joint_error: Largest |reference - true position| of any joint [rad].
        momentum_drift: Relative, see `MomentumLedger`.
        energy_drift: [J].
        saturated: Commands that a torque limit cut.
        max_attitude_error: Largest measured attitude error [rad]; None where the law leaves the
            base free.
    """

    steps: int
    duration: float
    messages: int
    max_joint_error: float
    momentum_drift: float
    energy_drift: float
    saturated: int
    max_attitude_error: float | None


def record_run(
    loop: ClosedLoop,
    steps: int,
    path: str | Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> RunSummary:
    """Run and write.

    Args:
        loop: The run, at its start.
        steps: Number of control periods.
        path: Folder of the bag.
        overwrite: Replace a bag that is there.
        progress: Called with the number of steps done.

    Raises:
        RecordingError: the bag can't be written; then none is.
        SimulationDivergedError: the run diverged; no bag is written.
    """
    plant = loop.plant
    every = max(1, round(LEDGER_PERIOD / plant.period))
    error, saturated = 0.0, 0
    attitude_error: float | None = None
    with BagWriter(path, overwrite=overwrite) as bag:
        if plant.robot.urdf:
            bag.text('/robot_description', plant.time_ns, plant.robot.urdf)
        for k, step in enumerate(loop.run(steps)):
            _write(bag, loop, step)
            if k % every == 0 or k == steps:
                book = bag.compose.ledger(step.stamp_ns, plant.ledger())
                bag.add('/simulator/ledger', book)
            if step.command is not None:
                error = max(error, _joint_error(step, step.command))
                saturated += bool(step.command.saturated.any() or step.command.base_saturated)
                if step.command.attitude_error is not None:
                    angle = float(np.linalg.norm(step.command.attitude_error))
                    attitude_error = max(attitude_error or 0.0, angle)
            progress(k)
    ledger = plant.ledger()
    return RunSummary(
        steps=steps,
        duration=steps * plant.period,
        messages=bag.message_count,
        max_joint_error=error,
        momentum_drift=ledger.momentum_drift,
        energy_drift=ledger.energy_drift,
        saturated=saturated,
        max_attitude_error=attitude_error,
    )


def _joint_error(step: Step, command: Command) -> float:
    n = len(command.tau)
    return float(np.max(np.abs(command.setpoint.q - step.state.q[:n]), initial=0.0))


def _write(bag: BagWriter, loop: ClosedLoop, step: Step) -> None:
    compose, ns = bag.compose, step.stamp_ns
    for topic, message in sample_messages(compose, loop.plant, step.measured):
        bag.add(topic, message)
    if loop.firings:
        shares = loop.firings.commands(ns // loop.plant.period_ns)
        bag.add(THRUSTERS, compose.joint_state(ns, loop.firings.names, effort=shares))
    if step.command is not None:
        command = compose.joint_state(ns, loop.joints, effort=step.command.tau)
        bag.add('/joint_commands', command)
        if step.command.base is not None:
            link = loop.plant.robot.base_link
            bag.add('/base_torque', compose.base_torque(ns, link, step.command.base))
