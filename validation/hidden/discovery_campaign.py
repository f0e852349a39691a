"""Campaign of laws that no catalogue knows: hidden in arms, asked for, held against the truth.

Every law of `hidden_laws`, inside and outside the grammar, at three times and once the noise, in
noise of all colours; those of `law_flights` in closed loop, on free and fixed bases; and machines
without any.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence

import numpy as np

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.balance.balance import Balance, balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.record import Record
from spacerobot_ros.types import Array

from ..campaigns import TrialRecord, key
from .discovery_tables import judge as judge
from .discovery_tables import results as results
from .discovery_tables import shown as shown
from .hidden_laws import COLOURS, INSIDE, LAWS, LawArm, variables_of
from .law_flights import FIELD, FIXED, FLOWN, FREE, LawFlight, beyond
from .real_arm import JOINTS, arm_file

_RATIOS = (3.0, 1.0)  # rms of a law by that of what is left
_DURATION = 40.0  # s
_MOVING = 3  # joints at once
_CLEAN = 4  # machines without a law, for every one with
_QUIET = 4  # in closed loop one without for so many with


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every law in turn, with machines without one in all colours; then closed loops."""
    out = []
    for seed in range(runs):
        for n, law in enumerate(LAWS):
            ratios = _RATIOS if law in INSIDE else _RATIOS[:1]
            colour = COLOURS[(seed + n) % len(COLOURS)]
            out += [key('law', 100 * seed + n, law, ratio, colour) for ratio in ratios]
        if not is_quick:
            clean = range(_CLEAN * len(LAWS) * seed, _CLEAN * len(LAWS) * (seed + 1))
            out += [key('clean', 10_000 + s, '', 0.0, COLOURS[s % len(COLOURS)]) for s in clean]
        for n, law in enumerate(
            FLOWN[seed % 2 :: 2]
        ):  # half of them a run: they take a minute each
            own = len(FLOWN) * seed + n
            base = FREE if law == FIELD or (n + seed // 2) % 2 else FIXED
            out.append(key('law', own, law, _RATIOS[0], base))
            if n % _QUIET < 2:
                out.append(key('clean', 10_000 + own, '', 0.0, base))
    return out


def run(key: str) -> TrialRecord:
    """Hide a law, ask, and compare what was learned along another motion."""
    kind, seed, law, ratio, colour = json.loads(key)
    is_flown = colour in (FREE, FIXED)
    kind_of = LawFlight if is_flown else HeldArm
    machine: LawFlight | HeldArm = kind_of(seed, law, ratio, colour)
    record = machine.record()
    started = time.perf_counter()
    answer = diagnose(record, machine.file.robot, machine.file.effects)
    wall = time.perf_counter() - started
    learned = [e.applied for e in answer.leftover or () if e.applied is not None]
    added = [*(c.applied for c in answer.causes), *answer.calibration, *learned]
    claims = [
        {
            'channel': e.channel.rpartition('/')[2],
            'depends_on': list(e.depends_on),
            'form': e.form,
            'p': e.p_value,
            'held_out': e.held_out_gain,
            'placebo': e.placebo_gain,
            'rivals': [list(r.depends_on) for r in e.rivals],
        }
        for e in answer.leftover or ()
    ]
    return {
        'kind': kind,
        'law': law,
        'ratio': ratio,
        'colour': colour,
        'where': machine.where if law else None,
        'variables': machine.variables if law else [],
        'claims': claims,
        'named': [[*c.applied.key] for c in answer.causes],
        'r2': machine.transferred(added) if law else None,
        'removed': machine.removed(added) if law and isinstance(machine, LawFlight) else None,
        'beyond': beyond(learned, machine.motion) if law else None,
        'wall_s': wall,
    }


class HeldArm:
    """An arm on the ground with a law, some of whose joints move.

    Args:
        seed: Of all. law: Empty: none. ratio: Rms of the law by that of the noise.
        colour: Of the noise.
    """

    def __init__(self, seed: int, law: str, ratio: float, colour: str) -> None:
        rng = np.random.default_rng([seed, 7])
        moving = sorted(rng.choice(len(JOINTS), _MOVING, replace=False).tolist())
        self._j, self._k = rng.choice(moving, 2, replace=False).tolist()
        self.file, self._names = arm_file(), [JOINTS[i] for i in moving]
        self._arm = LawArm(seed, colour=colour, law=law, place=(self._j, self._k))
        if law:
            self._arm = self._arm.sized(ratio, self._names, _DURATION)
        self.where = JOINTS[self._j]

    def record(self) -> Record:
        """With the law."""
        return self._arm.record(0, self._names, _DURATION)

    @property
    def variables(self) -> list[str]:
        """That a right answer names."""
        return variables_of(self._arm.law, self.where, JOINTS[self._k])

    @property
    def motion(self) -> Motion:
        """That of the record."""
        return self._balance(self.record()).motion

    def _balance(self, record: Record) -> Balance:
        return balance_of(observed(record, self.file.robot), self.file.robot, self.file.effects)

    def transferred(self, added: Sequence[Effect]) -> float:
        """Share of the law's variance on another motion that what was added explains there."""
        balance = self._balance(self._arm.record(1, self._names, _DURATION))
        motion, j = balance.motion, self._j
        true = self._arm.hidden_torque(motion.q, motion.qd, motion.effort)
        own: Array = np.zeros(len(true))
        for effect in added:  # a coupled friction acts on two joints
            if effect.acts('force'):
                own = own + effect.force(motion, effect.driven(motion))[:, 6 + j]
        at = balance.arm.is_moving[:, j]
        return 1.0 - float(np.var(true[at] - own[at]) / np.var(true[at]))
