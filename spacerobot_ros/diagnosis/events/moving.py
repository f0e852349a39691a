"""Pulses of torque on the joints of an arm that moves: looked for, left out, and measured.

A push of a second passes for a wandering friction, and several for a level beside which none
stands out. So whatever might be one is left out of the rows, and the level of the rest found
again, until nothing more is suspected; what is none beside that level comes back. Where none is
large even so, only what is listed is left out: a quiet machine's level is that of all its rows.
Each pulse is then measured beside all other rows, its start, end and edges where the likelihood is
largest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...estimation.balance.arm_rows import ArmRows
from ...types import Array, BoolArray
from .contact import Pulse, overlap
from .event_limits import LISTED, NAMED, QUIET, QUIET_SIZE, ROOM, SNR, SUSPECTED
from .joint_scan import SPREAD, Pulses, bells
from .scan import Filtered, PulseScan

DURATIONS = (0.3, 0.6, 1.2, 2.4, 4.8)
"""Of the templates of a scan [s]; a bell half or twice as long still gives 94 % of its z."""
_PASSES = 3
_GUESS = 0.03  # of a joint's torque, for a first look
_EDGES = (0.5, 0.25, 0.1)
_SHORTEST, _LONGEST = 0.25, 10.0  # s


class PulseSearch:
    """All pulses of some recordings.

    Args:
        rows: The recordings.
    """

    def __init__(self, rows: ArmRows) -> None:
        self.rows = rows
        ones = [np.ones(len(joint.torque)) for joint in rows.joints]
        guess = [np.full(6, (_GUESS * scale) ** 2) for scale in (*rows.scale, *rows.scale)]
        scales = scatter_scales(PulseScan.of(rows, ones, guess), ones)
        first = PulseScan.of(rows, scales, [None] * len(scales))
        self.found = self._search(first, scales, SUSPECTED)
        if not any(abs(p.z) >= NAMED for p in self.found):
            self.found = self._search(first, scales, LISTED)

    def _search(self, first: PulseScan, scales: Sequence[Array], least: float) -> list[Pulse]:
        """What is listed, beside a level without what exceeds some z."""
        self._windows: list[Pulse] = []
        self.scan, self._scales = first, scales
        for _ in range(_PASSES):
            fresh = self._look(least)
            self._windows += fresh
            if not fresh:
                break
        if not self._windows:
            return []
        self._windows = self._best()
        self._scales = scatter_scales(self.scan, self._scales)
        fresh = self._look(LISTED)
        if fresh:
            self._windows += fresh
            self._look(LISTED)
        return self._best()

    def _look(self, least: float) -> list[Pulse]:
        """What exceeds some z beside the rows that are kept, their level found again."""
        self.scan = self.scan.without(self._left_out(), self._scales)
        self.colours: dict[tuple[int, float], float] = {}
        self._stds: dict[tuple[int, float], float] = {}
        return [p for j in range(self.rows.robot.n_joints) for p in self._peaks(j, least)]

    def _best(self) -> list[Pulse]:
        """What is left out and listed, where it is most likely, without what overlaps."""
        out: list[Pulse] = []
        for p in sorted(map(self._measured, self._windows), key=lambda p: -abs(p.z)):
            is_new = not any(q.joint == p.joint and overlap(p, q) for q in out)
            if abs(p.z) >= LISTED and is_new:
                out.append(p)
        return out

    def _left_out(self) -> list[BoolArray]:
        out = [np.zeros(len(joint.torque), dtype=bool) for joint in self.rows.joints]
        for w in self._windows:
            time, joint = self.rows.joint_times(w.joint), self.rows.joints[w.joint]
            inside = (time > w.start - SPREAD) & (time < w.end + SPREAD)
            out[w.joint] |= inside & (self.rows.recording[joint.block] == w.run)
        return out

    def _peaks(self, j: int, least: float) -> Iterator[Pulse]:
        """Largest templates of a joint that do not overlap, beyond some z."""
        seen: list[Pulse] = []
        for duration in DURATIONS:
            found = [
                (run, bells(self.rows, run, duration), self.scan.test_kept(j, run, duration))
                for run in range(len(self.rows.balances))
            ]
            colour = self.colours[j, duration] = _colour([f.z for _, _, f in found])
            stds = np.concatenate([f.std for _, _, f in found])
            self._stds[j, duration] = _usual(stds[np.isfinite(stds)])
            seen += [
                _pulse(j, run, tried, f, k, colour)
                for run, tried, f in found
                for k in np.flatnonzero(np.abs(f.z) >= least * colour).tolist()
            ]
        taken: list[Pulse] = []
        for p in sorted(seen, key=lambda p: -abs(p.z)):
            if not any(overlap(p, q) for q in taken):
                taken.append(p)
                yield p

    def _measured(self, window: Pulse) -> Pulse:
        """A pulse where its likelihood is largest."""
        best = window
        for shifts, factors in (
            (np.linspace(-0.5, 0.5, 9), 2.0 ** np.linspace(-1.0, 1.0, 7)),
            (np.linspace(-0.1, 0.1, 5), 2.0 ** np.linspace(-0.25, 0.25, 5)),
        ):
            duration = best.end - best.start
            grid = np.array(
                [
                    (0.5 * (best.start + best.end) + shift * duration, factor * duration, edge)
                    for shift in shifts
                    for factor in factors
                    for edge in _EDGES
                    if _SHORTEST <= factor * duration <= _LONGEST
                ]
            )
            pulses = Pulses(*grid.T)
            found = self.scan.test(best.joint, best.run, pulses)
            at = int(np.argmax(np.abs(found.z)))
            if not found.z[at]:
                return window
            colour = self.colour(best.joint, float(pulses.duration[at]))
            best = _pulse(best.joint, best.run, pulses, found, at, colour)
        return best

    def usual_std(self, j: int, duration: float) -> float:
        """Standard deviation of a bell of one of `DURATIONS` on a joint [N m]; inf: unseen."""
        return self._stds[j, duration] * self.colours[j, duration]

    def colour(self, j: int, duration: float) -> float:
        """By how much z scatters more than in white noise."""
        near = min(DURATIONS, key=lambda d: abs(np.log(d / duration)))
        return self.colours[j, near]


def _usual(stds: Array) -> float:
    """By which `SNR` is enough at 19 of 20 times, or the median if that is larger."""
    if not len(stds):
        return np.inf
    return max(float(np.median(stds)), ROOM * NAMED / SNR * float(np.quantile(stds, 0.95)))


def _colour(z: Sequence[Array]) -> float:
    seen = np.abs(np.concatenate(z))
    seen = seen[seen > 0.0]
    return max(1.0, float(np.quantile(seen, QUIET)) / QUIET_SIZE) if len(seen) else 1.0


def _pulse(j: int, run: int, shapes: Pulses, found: Filtered, k: int, colour: float) -> Pulse:
    start, end, edge = (float(x[k]) for x in (shapes.start, shapes.end, shapes.edge))
    torque, std, z = (float(x[k]) for x in (found.torque, found.std, found.z))
    return Pulse(j, run, start, end, edge, torque, std * colour, z / colour)


_SLOW = 0.1  # of the 95 % rate: over which friction turns
_FLOOR = 0.1  # of the median of what is left: less is as good as that
_RIDGE = 10.0  # rows without any scatter
_LEAST = 1.0  # of the median scale: where little is left of the model, it may be chance


def scatter_scales(scan: PulseScan, before: Sequence[Array]) -> list[Array]:
    """(M,) scale of every joint's rows.

        log |left| = x' c + noise,

    over features x of a joint's rows: how slow it is, how fast, how fast the whole arm is, how
    much it accelerates, and the recording. Rows are divided by exp(x' c), so that the level of
    what is left is that of all rows. Without it a reversal looks like a push, and all other rows
    like noise; so does a rough drive's recording among smooth ones.

    Args:
        scan: A model, its rows by the scales before.
        before: Those.
    """
    out = []
    for j, scale in enumerate(before):
        kept = ~scan.joints[j].left_out
        left = np.abs(scan.left(j)) * scale[kept]
        if not len(left) or not np.median(left) > 0.0:
            out.append(np.ones(len(scale)))
            continue
        features = _features(scan.rows, j)
        features = (features - np.mean(features, axis=0)) / np.maximum(
            np.std(features, axis=0), 1e-9
        )
        logs = np.log(left / np.median(left) + _FLOOR)
        own = features[kept]
        square = own.T @ own + _RIDGE * np.eye(features.shape[1])
        share = np.exp(features @ np.linalg.solve(square, own.T @ (logs - np.mean(logs))))
        out.append(np.maximum(share / np.median(share), _LEAST))
    return out


def _features(rows: ArmRows, k: int) -> Array:
    """(M, 4 + R) of the rows of a set, the last of them each recording's."""
    out, j = [], k % rows.robot.n_joints
    for run, balance in enumerate(rows.balances):
        arm = balance.arm
        rate, turn = np.abs(arm.kinematics.qd), np.abs(arm.kinematics.qdd)
        usual = np.maximum(np.quantile(rate, 0.95, axis=0), 1e-9)
        slow = np.exp(-((rate[:, j] / (_SLOW * usual[j])) ** 2))
        each = [slow, rate[:, j] / usual[j], np.mean(rate / usual, axis=1)]
        each.append(np.mean(turn / np.maximum(np.quantile(turn, 0.95, axis=0), 1e-9), axis=1))
        smooth = np.maximum(arm.in_band(np.column_stack(each)), 0.0)
        smooth[:, 1:] = np.log(smooth[:, 1:] + 0.05)
        moving = smooth[:: arm.stride][rows.rows_at(balance, k)]
        own = np.arange(len(rows.balances)) == run
        out.append(np.column_stack([moving, np.tile(own, (len(moving), 1))]))
    return np.concatenate(out)
