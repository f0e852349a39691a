r"""Unknowns that are estimated beside the momentum and the inertial parameters.

Each is an effect of the catalogue (docs/effects.md, the same ids) that is always there, its
plausible size the prior about zero. What it does to the sensors is its `sense` and `delay`; what
it does to the balance of momentum is its own `momentum`, or its torque, which is constant in the
inertial frame, times the time; wheels of which an effect takes momentum are those of the present
estimate. Columns are differences of these.

`torque_hold` is no effect but the filter's own correction of sampled control (`torque_hold.py`).
Drags are unknown as 1/tau. Times count from the first sample of a run; delays count against the
joint states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...effects.effect import Effect
from ...effects.motion import Motion
from ...effects.parameter import Parameter
from ...errors import ConfigurationError
from ...model.robot import Robot
from ...types import Array
from ..trajectory.reference import Kinematics
from ..trajectory.sampled_motion import misreading
from .torque_hold import Holds

TORQUE_HOLD = 'torque_hold'
_HOLD = Parameter(TORQUE_HOLD, 's^2', 1e-4)
"""Its standard deviation: that of torques which are held for 35 ms."""
_IDS = (
    'gyro_bias',
    'encoder_offset',
    'imu_delay',
    'attitude_delay',
    TORQUE_HOLD,
    'external_torque_inertial',
    'target_wheel_drag',
    'servicer_wheel_drag',
)
_STEP = 1e-5  # of the prior's standard deviation; actions are linear, or nearly, in that


class _Unknown(NamedTuple):
    """One number of an effect, at one or several places at once; no effect for `torque_hold`."""

    name: str
    parameter: Parameter = _HOLD
    kind: type[Effect] | None = None
    places: tuple[str | None, ...] = ()

    @property
    def is_inverse(self) -> bool:
        return self.parameter.role == 'reciprocal'

    @property
    def unit(self) -> str:
        return f'1/{self.parameter.unit}' if self.is_inverse else self.parameter.unit

    def acts(self, *actions: str) -> bool:
        return self.kind is not None and any(self.kind.acts(action) for action in actions)

    def bound(self, value: float) -> tuple[Effect, ...]:
        if self.kind is None:
            return ()
        if self.is_inverse:
            value = 1.0 / value if value else np.inf
        values = {**self.kind.nominal(), self.parameter.name: value}
        return tuple(self.kind(name=self.name, where=at, values=values) for at in self.places)

    def slope(self, action: Callable[[tuple[Effect, ...]], Array], value: float) -> Array:
        """Derivative by the unknown of what its effects do."""
        step = _STEP * self.parameter.size
        ahead, behind = (action(self.bound(value + s)) for s in (step, -step))
        return (ahead - behind) / (2.0 * step)


class Nuisances:
    """The nuisances of one estimate, in a row.

    Args:
        ids: Of effects.
        robot: The robot.

    Attributes:
        size: Number m of unknowns. names: Of each, such as `gyro_bias_x`. units: Of each.
        is_external: (m,) which add momentum from outside.

    Raises:
        ConfigurationError: an id that can not be estimated beside the momentum.
    """

    def __init__(self, ids: tuple[str, ...], robot: Robot) -> None:
        for i, kind in enumerate(ids):
            if kind not in _IDS or kind in ids[:i]:
                known = ', '.join(_IDS)
                raise ConfigurationError(
                    f'identifier.nuisances[{i}]', f'{kind!r} is not one of {known}, each once'
                )
        self._robot = robot
        self._unknowns = [unknown for kind in ids for unknown in _unknowns(kind, robot)]
        self.size = len(self._unknowns)
        self.names = tuple(unknown.name for unknown in self._unknowns)
        self.units = tuple(u.unit for u in self._unknowns)
        self.is_external = np.array(
            [u.kind is not None and u.kind.is_external for u in self._unknowns], dtype=bool
        )
        self.acts_on_momentum = any(u.acts('force', 'momentum') for u in self._unknowns)
        self.torque_hold = self.names.index(TORQUE_HOLD) if TORQUE_HOLD in ids else None

    def prior(self, holds: Holds | None = None) -> tuple[Array, Array]:
        """(m,) means and standard deviations; a known period of holds tells `torque_hold`."""
        mean, std = np.zeros(self.size), np.array([u.parameter.size for u in self._unknowns])
        known = None if holds is None else holds.prior()
        if known is not None and self.torque_hold is not None:
            mean[self.torque_hold], std[self.torque_hold] = known
        return mean, std

    def misreadings(
        self, values: Array, channel: str, at: Kinematics, held: Array | None = None
    ) -> tuple[Array, Array]:
        """By how much a channel reads more than the truth.

        Args:
            values: (m,) of the nuisances.
            channel: Name.
            at: The truth at N samples.
            held: (N, width) what holding torques takes off the channel, a unit of k; None where
                it takes nothing, or is not estimated.

        Returns:
            (N, width), and (N, width, m) its derivatives.
        """
        motion = self._motion(at, self._robot.target_momentum)
        nothing = np.zeros_like(at.q if channel.startswith('joint') else at.omega)

        def read(effects: Iterable[Effect]) -> Array:
            return sum((misreading(effect, channel, at, motion) for effect in effects), nothing)

        total, columns = self._act(('sense', 'delay'), read, values, nothing)
        if held is not None and self.torque_hold is not None:
            total -= values[self.torque_hold] * held
            columns[..., self.torque_hold] = -held
        return total, columns

    def imbalance(self, values: Array, at: Kinematics, aam: Array) -> tuple[Array, Array, Array]:
        """What the effects add to R^T h_W - sum R_b h_b - Y x - h0, in the base frame.

        It is linear in the captured wheels' momentum, of which effects take a share.

        Args:
            values: (m,) of the nuisances.
            at: N times.
            aam: (3 n_links,) momentum of the captured wheels [N m s].

        Returns:
            (N, 3), and its derivatives (N, 3, m) by the nuisances and (N, 3, 3 n_links) by the
            momentum.
        """
        nothing = np.zeros_like(at.omega)

        def added(momentum: Array) -> tuple[Array, Array]:
            motion = self._motion(at, momentum)

            def all_of(effects: Iterable[Effect]) -> Array:
                return sum((_added_momentum(effect, motion) for effect in effects), nothing)

            return self._act(('force', 'momentum'), all_of, values, nothing)

        rest, _ = added(np.zeros_like(aam))
        by_aam = np.zeros((*nothing.shape, len(aam)))
        for k, unit in enumerate(np.eye(len(aam))):
            by_aam[..., k] = added(unit)[0] - rest
        return *added(aam), by_aam

    def _act(
        self,
        actions: tuple[str, ...],
        what: Callable[[tuple[Effect, ...]], Array],
        values: Array,
        nothing: Array,
    ) -> tuple[Array, Array]:
        """What the effects that have some action do in all, and its derivatives."""
        total, columns = nothing.copy(), np.zeros((*nothing.shape, self.size))
        for j, unknown in enumerate(self._unknowns):
            if unknown.acts(*actions):
                total += what(unknown.bound(values[j]))
                columns[..., j] = unknown.slope(what, values[j])
        return total, columns

    def _motion(self, at: Kinematics, aam: Array) -> Motion:
        robot = self._robot.with_target_momentum(aam)
        zeros = np.zeros_like(at.q)
        return Motion(robot, at.time, at.q, at.qd, zeros, rotation=at.matrices, omega=at.omega)


def _added_momentum(effect: Effect, motion: Motion) -> Array:
    """(N, 3) that an effect adds to the balance, in the base frame [N m s]."""
    none = np.zeros((len(motion), 0))
    if effect.is_external:
        return effect.force(motion, none)[:, 3:6] * motion.time[:, None]
    return -effect.momentum(motion, none)[:, 3:]


def _unknowns(kind_id: str, robot: Robot) -> list[_Unknown]:
    """Every number of a nuisance: one a joint, one an axis, or one for all its places."""
    if kind_id == TORQUE_HOLD:
        return [_Unknown(kind_id)]
    kind = CATALOGUE[kind_id]
    places, (first, *more) = kind.places(robot), kind.parameters
    if kind_id == 'encoder_offset':
        return [
            _Unknown(f'{kind_id}_{i}', first, kind, (at,)) for i, at in enumerate(places, start=1)
        ]
    return [
        _Unknown(f'{kind_id}_{p.name}' if more else kind_id, p, kind, places)
        for p in kind.parameters
    ]
