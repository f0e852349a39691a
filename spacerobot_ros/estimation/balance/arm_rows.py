"""Recordings of one arm as linear rows: every cause that an arm may have, at every place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect
from ...effects.prior import NOTHING
from ...inference.gram import Gram
from ...model.robot import Robot
from ...types import Array, BoolArray, IntArray
from ..columns import Candidate
from .anchor import HELD, scale_columns, unanchored
from .arm_candidates import GAIN, ZEROS, arm_candidates, candidates_of_recordings
from .arm_columns import columns_of
from .arm_priors import DRY, Machine
from .balance import Balance, rms
from .leftover import JointRows, shape_sizes
from .row_blocks import CLUSTERS_AT_MOST, blocks_of, clusters_of

_OF_MOTION = ('_own_scale', 'anchors', 'unanchored', 'scale', 'is_driven', 'shapes')
_OF_ROWS = ('columns', 'torques', 'blocks')
_TOLERATED = 1e-3  # of a size; `arm_priors` gives less to what no machine has


@dataclass(frozen=True, eq=False)
class ArmRows:
    """R recordings of one robot about one model.

    Args:
        balances: The model along every recording.
        candidates: Causes that may be, with plausible sizes.
        tolerances: (K,) what their coefficients are on any machine.
        about: Coefficients about which rows without a torque are linearized, of the first
            candidates or all; None: the model.
    """

    balances: tuple[Balance, ...]
    candidates: tuple[Candidate, ...]
    tolerances: Array
    about: Array | None = field(default=None, kw_only=True)

    @classmethod
    def of(cls, balances: Sequence[Balance], kinds: Iterable[type[Effect]]) -> ArmRows:
        """With every effect of a catalogue that an arm may have."""
        robot = balances[0].robot
        machine = Machine(robot, balances)
        found, tolerances = [], []
        for candidate in arm_candidates(kinds, balances):
            prior = machine.prior(candidate)
            if prior is not None:
                found.append(candidate.with_prior(prior))
                tolerances.append(prior.tolerances)
        return cls(tuple(balances), tuple(found), np.concatenate(tolerances))

    def with_own(self, loaded: Sequence[int]) -> ArmRows:
        """With what recordings may have of their own; see `candidates_of_recordings`."""
        count = len(self.balances)
        return self.with_more(
            [*candidates_of_recordings(self.candidates, self.robot, count, loaded)]
        )

    def with_more(
        self, more: Sequence[Candidate], about: Sequence[Balance] | None = None
    ) -> ArmRows:
        """With further candidates, which no machine has unless they are chosen.

        Args:
            more: The candidates.
            about: Balances about which their columns are made; None: those of the rows.
        """
        if not more:
            return self
        tolerances = [self.tolerances, *(NOTHING * c.sizes for c in more)]
        out = replace(
            self, candidates=(*self.candidates, *more), tolerances=np.concatenate(tolerances)
        )
        both = zip(self.columns, columns_of(about or self.balances, more), strict=True)
        out.__dict__['columns'] = [np.concatenate(pair, axis=2) for pair in both]
        return out

    @property
    def own_zeros(self) -> list[int]:
        """Candidates that are zeros of single recordings."""
        every = enumerate(self.candidates)
        return [i for i, c in every if c.recordings and c.kind.id in ZEROS]

    @cached_property
    def sizes(self) -> Array:
        """(K,) plausible sizes."""
        return np.concatenate([c.sizes for c in self.candidates])

    @cached_property
    def anchors(self) -> Array:
        """(A, K) changes of scales that nothing measured tells, which stay as in the file."""
        return scale_columns(self.balances, self.candidates, self.unanchored)

    @cached_property
    def _own_scale(self) -> Array:
        """(n, K) relative change of the own weight of each joint that has no motor, or one off.

        Where the torque is zero a model of c times the size misses c times as much, and none of
        nothing: what counts is the missed torque e by that size, e / (1 + a x), whose slope is
        that of e and e a more.
        """
        off = np.any([b.arm.unpowered.any(axis=0) for b in self.balances], axis=0)
        out = np.zeros((len(off), len(self.sizes)))
        joints = np.flatnonzero(off)
        out[joints] = scale_columns(self.balances, self.candidates, [[int(j)] for j in joints])
        return out

    def linearized(self, about: Array) -> ArmRows:
        """The same rows about other coefficients (K,)."""
        return self._alike(about) if self._own_scale.any() else self

    def along(self, balances: Sequence[Balance]) -> ArmRows:
        """The same candidates along other stretches of a motion, by the scales of this one."""
        out = replace(self, balances=tuple(balances))
        out.__dict__.update({name: getattr(self, name) for name in _OF_MOTION})
        return out

    def about_others(
        self, columns: Sequence[Array], torques: Sequence[Array] | None = None
    ) -> ArmRows:
        """The same rows with other columns (M, n, K), and missed torques (M, n), by recording."""
        out = self._alike(self.about)
        out.__dict__['columns'] = columns
        if torques is not None:
            out.__dict__['torques'] = torques
        return out

    def _alike(self, about: Array | None) -> ArmRows:
        out = replace(self, about=about)
        out.__dict__.update({name: getattr(self, name) for name in (*_OF_MOTION, *_OF_ROWS)})
        return out

    @cached_property
    def unanchored(self) -> list[list[int]]:
        """Numbers of the joints of every branch where no torque is measured."""
        return unanchored(self.balances)

    @property
    def held(self) -> Gram:
        """Sums of the rows that hold these scales."""
        rows = self.anchors / HELD
        return Gram(rows.T @ rows, np.zeros(rows.shape[1]), 0.0, 0)

    @property
    def robot(self) -> Robot:
        """The model's."""
        return self.balances[0].robot

    def is_tolerated(self, i: int) -> bool:
        """Whether a candidate is a little there on any machine."""
        at = self.places[i]
        return bool(np.any(self.tolerances[at] > _TOLERATED * self.sizes[at]))

    @cached_property
    def places(self) -> list[IntArray]:
        """Columns of every candidate."""
        ends = np.cumsum([len(c.sizes) for c in self.candidates]).tolist()
        return [np.arange(a, b) for a, b in pairwise([0, *ends])]

    def acts_on(self, i: int, j: int) -> bool:
        """Whether the rows of joint j show a candidate."""
        return bool(np.any(self.joints[j].columns[:, self.places[i]]))

    def deviations(self, chosen: Iterable[int], absent: Iterable[int] = ()) -> Array:
        """(K,) the sizes of what is chosen and the tolerances of the rest, but for the absent."""
        out = self.tolerances.copy()
        for i in chosen:
            out[self.places[i]] = self.sizes[self.places[i]]
        for i in absent:
            out[self.places[i]] = NOTHING * self.sizes[self.places[i]]
        return out

    @cached_property
    def columns(self) -> list[Array]:
        """(M, n, K) of every recording [N m by coefficient]."""
        return columns_of(self.balances, self.candidates)

    @cached_property
    def scale(self) -> Array:
        """(n,) rms of the torques where the joints move, `Machine.torque` [N m]."""
        return Machine(self.robot, self.balances).torque

    @cached_property
    def judged_by(self) -> Array:
        """(n,) torques of which a cause must be some share to matter [N m].

        Those of the joint, which no sensor measures but for a share of them. The torque of one
        without a motor is known: there it is what the model misses.
        """
        is_passive = np.isin(self.robot.joints, self.robot.passive_joints)
        return np.where(is_passive, rms(self.balances), self.scale)

    @cached_property
    def friction(self) -> Array:
        """(n,) Coulomb friction that the model believes in [N m]."""
        machine = Machine(self.robot, self.balances)
        return np.array([machine.friction(DRY, j) for j in self.robot.joints])

    @cached_property
    def blocks(self) -> list[IntArray]:
        """(M,) number of the block of each row, recording by recording."""
        return blocks_of(self.balances)

    @property
    def in_clusters(self) -> ArmRows:
        """The same rows in blocks that err each for itself."""
        return self.clusters(CLUSTERS_AT_MOST)

    def clusters(self, most: int) -> ArmRows:
        """The same, so many blocks at the most."""
        return self._cut(clusters_of(self.balances, most))

    def over(self, sizes: Mapping[int, Array]) -> ArmRows:
        """The same by the sizes (M,) of the noise of rows, of some sets of `joints`."""
        out = self._alike(self.about)
        out.__dict__['joints'] = [
            own.over(sizes[k]) if k in sizes else own for k, own in enumerate(self.joints)
        ]
        return out

    def _cut(self, blocks: list[IntArray]) -> ArmRows:
        out = self._alike(self.about)
        out.__dict__['blocks'] = blocks
        pairs = [*zip(self.balances, blocks, strict=True)]
        out.__dict__['joints'] = [
            replace(rows, block=np.concatenate([own[self.rows_at(b, k)] for b, own in pairs]))
            for k, rows in enumerate(self.joints)
        ]
        return out

    @cached_property
    def recording(self) -> IntArray:
        """(B,) number of the recording of each block."""
        counts = [b[-1] - b[0] + 1 for b in self.blocks]
        return np.repeat(np.arange(len(counts)), counts)

    @cached_property
    def torques(self) -> list[Array]:
        """(M, n) that the model misses in every recording [N m]."""
        return [balance.torque for balance in self.balances]

    def torque(self, run: int) -> Array:
        """(M, n) torques that the model misses in a recording [N m]."""
        return self.torques[run]

    @cached_property
    def is_driven(self) -> BoolArray:
        """(n,) whether a joint has a motor that is ever on."""
        return np.asarray(np.any([b.arm.powered.any(axis=0) for b in self.balances], axis=0))

    def rows_at(self, balance: Balance, k: int) -> IntArray:
        """Rows of a recording that belong to set k of `joints`."""
        n, arm = self.robot.n_joints, balance.arm
        state = arm.powered if k < n else arm.unpowered
        if k < n and not self.is_driven[k]:
            state = arm.unpowered
        rows = (arm.is_moving & state)[:: arm.stride, k % n]
        return np.flatnonzero(rows & (k < n or self.is_driven[k % n]))

    @cached_property
    def shapes(self) -> list[Array]:
        """(2,) of every set of `joints`: rms of what friction leaves near its turns and rests."""
        n = self.robot.n_joints
        every = (
            [_shapes(b, self.rows_at(b, k), k % n) for b in self.balances] for k in range(2 * n)
        )
        return [shape_sizes(np.concatenate(own)) for own in every]

    def joint(self, k: int) -> JointRows:
        """Set k of `joints`."""
        j = k % self.robot.n_joints
        torque, columns, observed, block, gap = [], [], [], [], []
        parts = zip(self.balances, self.columns, self.blocks, strict=True)
        for run, (balance, full, own) in enumerate(parts):
            stride = balance.arm.stride
            at = self.rows_at(balance, k)
            times = balance.row_times[at]
            missed, moved = self.torque(run)[at, j], full[at, j]
            if k >= self.robot.n_joints or not self.is_driven[j]:
                known = np.zeros(0) if self.about is None else self.about
                about = np.pad(known, (0, full.shape[2] - len(known)))
                # torques by their gain are these times the gain where nothing is measured
                moved[:, self._gain_at(j)] = (moved @ about)[:, None]
                left = missed - moved @ about
                grown = self._own_scale[j] / (1.0 + max(self._own_scale[j] @ about, -0.5))
                missed, moved = missed + left * (grown @ about), moved + np.outer(left, grown)
            torque.append(missed)
            columns.append(moved)
            needed = balance.motion.effort[::stride, j][at]
            direction = np.sign(balance.motion.qd[::stride, j][at])
            shapes = _shapes(balance, at, j) / self.shapes[k]
            observed.append(np.column_stack([direction, needed / self.scale[j], shapes]))
            block.append(own[at])
            gap.append(np.diff(times, prepend=times[:1]))
        return JointRows(
            np.concatenate(torque),
            np.concatenate(columns),
            np.concatenate(observed),
            np.concatenate(block),
            np.concatenate(gap),
        )

    def _gain_at(self, j: int) -> IntArray:
        """Column of the gain of a joint's torques, if it has one."""
        key = GAIN, self.robot.joints[j]
        own = (self.places[i] for i, c in enumerate(self.candidates) if c.key == key)
        return np.concatenate([np.zeros(0, dtype=int), *own])

    def joint_times(self, k: int) -> Array:
        """(M,) times of the rows of set k, each of its recording [s]."""
        return np.concatenate([b.row_times[self.rows_at(b, k)] for b in self.balances])

    @cached_property
    def joints(self) -> list[JointRows]:
        """Rows of every joint where it moves; then, n sets more, of those whose motor is off.

        What is left there is no error of a measured torque, and has a level of its own.
        """
        return [self.joint(k) for k in range(2 * self.robot.n_joints)]

    def parts(self, levels: Sequence[Array]) -> list[Gram]:
        """Gram matrices of every block, whitened.

        Args:
            levels: (8,) variances of the leftover of every set of `joints`, or of the first n.
        """
        k = len(self.tolerances)
        out = [Gram(np.zeros((k, k)), np.zeros(k), 0.0, 0) for _ in self.recording]
        for rows, variances in zip(self.joints, levels, strict=False):
            if len(rows.torque) and np.isfinite(variances).all():
                torque, columns, _ = rows.whitened(variances)
                for block in np.unique(rows.block):
                    own = rows.block == block
                    out[block] += Gram.of(columns[own], torque[own])
        return out


def _shapes(balance: Balance, at: IntArray, j: int) -> Array:
    """(M, 2) of rows of a joint: late and unsure friction."""
    return np.column_stack([x[at, j] for x in balance.arm.unsure])
