"""All events of recordings of an arm on the ground: of joints that move, and at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...estimation.balance.arm_priors import DRY, OF_LOAD, Machine
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance
from .break_away import break_away
from .directed_gains import with_directed_gains
from .event import Events, Spans
from .joint_scan import SPREAD
from .moving import PulseSearch
from .naming import Naming
from .rest import rest_events


@dataclass(frozen=True, slots=True, eq=False)
class ArmEvents:
    """Events, and the times of each recording that they take.

    What happens once says nothing of a machine, whether it is large enough for a name or not.
    """

    events: Events = field(default_factory=Events)
    left_out: tuple[Spans, ...] = ()


def arm_events(balances: Sequence[Balance], rows: ArmRows | None) -> ArmEvents:
    """Events of some recordings of one arm.

    Args:
        balances: The model along every recording.
        rows: The same as rows; None where no joint moves.
    """
    robot = balances[0].robot
    machine = Machine(robot, balances)
    known = [machine.friction(DRY, joint) for joint in robot.joints]
    friction = np.array(known)
    of_load = np.array([machine.friction(OF_LOAD, joint) for joint in robot.joints])
    found, scan = Events(recordings=len(balances)), None
    if rows is not None:
        search = PulseSearch(with_directed_gains(rows))
        naming, scan = Naming(search), search.scan
        found = found.with_more(naming.events())
        slides = np.array([naming.coulomb(j) for j in range(robot.n_joints)])
        friction = np.maximum(slides, break_away(balances))
        of_load = np.array([naming.of_load(j) for j in range(robot.n_joints)])
    friction = np.where(friction > 0.0, friction, np.nan)
    for run, balance in enumerate(balances):
        found = found.with_more(rest_events(balance, run, friction, of_load, scan))
    once = [(e.recording, e.start, e.end) for e in found.named]
    once += [(e.recording, e.start, e.end) for e in found.possible if e.reason == 'weak']
    spans = [
        tuple((start - SPREAD, end + SPREAD) for run, start, end in once if run == own)
        for own in range(len(balances))
    ]
    return ArmEvents(found, tuple(spans))
