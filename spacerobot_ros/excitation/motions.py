"""Motions of one robot within its limits, free or fixed base, whatever they are made for.

They are Fourier series plus quintics, linear in their coefficients,

    q(t) = q_start + sum_m x_m f_m(t)

with the x_m [rad] the amplitudes of sine and cosine of each harmonic, and each f_m brought to rest
at both ends by its own quintic (`control.joint_reference.Fourier`). Scaling all amplitudes scales
rates and accelerations alike, which makes any motion gentle enough. A designed one is written as a
complete robot file, which every tool loads like its template.

Symbols: B candidates, T times, n joints, H harmonics.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..control.joint_reference import Fourier
from ..dynamics.state import initial_state
from ..errors import ConfigurationError
from ..estimation.trajectory.base_response import BaseMotion, BaseResponse, BaseStart
from ..estimation.trajectory.motion_limits import Limits
from ..model.files import read_parameters, write_parameters
from ..model.motion_settings import ReferenceSettings
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array


class MotionFamily:
    """Joint motions at fixed times.

    Args:
        duration: [s].
        harmonics: Number H.
        start: (n,) joint positions at both ends [rad].
        times: (T,) from 0 to the duration [s].
    """

    def __init__(self, duration: float, harmonics: int, start: Array, times: Array) -> None:
        self.duration, self.harmonics, self.start, self.times = duration, harmonics, start, times
        self._rates = 2.0 * np.pi / duration * np.arange(1, harmonics + 1)
        zero = np.zeros((harmonics, harmonics))
        basis = Fourier(
            np.concatenate([np.diag(self._rates), zero]),
            np.concatenate([zero, np.diag(self._rates)]),
            duration,
            np.zeros(2 * harmonics),
        )
        self._curves = basis.along(times)

    @property
    def size(self) -> int:
        """Number of amplitudes, 2 H n."""
        return 2 * self.harmonics * len(self.start)

    def at(self, times: Array) -> MotionFamily:
        """The same family at other times."""
        return MotionFamily(self.duration, self.harmonics, self.start, times)

    def motion(self, x: Array) -> tuple[Array, Array, Array]:
        """Positions, rates and accelerations (B, T, n) of candidates x (B, 2 H n)."""
        amplitudes = x.reshape(len(x), len(self.start), -1)
        q, qd, qdd = (np.einsum('tm,bnm->btn', curve, amplitudes) for curve in self._curves)
        return q + self.start, qd, qdd

    def amplitudes(self, reference: ReferenceSettings) -> Array:
        """(2 H n,) amplitudes of a Fourier motion: harmonics that it lacks are zero, higher cut.

        A motion of another duration keeps its amplitudes and changes its rates.
        """
        rates = 2.0 * np.pi / reference.duration * np.arange(1, reference.harmonics + 1)
        x = np.zeros((len(self.start), 2, self.harmonics))
        shared = min(self.harmonics, reference.harmonics)
        for part, values in enumerate((reference.sine, reference.cosine)):
            table = np.reshape(values, (len(self.start), -1)) / rates
            x[:, part, :shared] = table[:, :shared]
        return x.ravel()

    def reference(self, x: Array) -> ReferenceSettings:
        """Section `reference` of a robot file for one candidate x (2 H n,)."""
        table = x.reshape(len(self.start), 2, self.harmonics) * self._rates
        return replace(
            ReferenceSettings(),
            kind='fourier',
            duration=self.duration,
            harmonics=self.harmonics,
            sine=tuple(table[:, 0].ravel().tolist()),
            cosine=tuple(table[:, 1].ravel().tolist()),
        )


class Chosen(NamedTuple):
    """One motion, joints and base.

    Attributes:
        family: It is one of these. x: (size,) its amplitudes [rad]. start: Of the base.
    """

    family: MotionFamily
    x: Array
    start: BaseStart


_FINE = 4  # times as many nodes for the final check of the limits
_NODES = 40  # a cycle of the highest harmonic
_LEVELS = 8  # factors tried at once when scaling
_ROUNDS = 6  # of scaling, each narrowing the factor to one level
_CHECKS = 8  # of a scaled motion on the fine grid
SAFE = 1.0 - 1e-6
"""Share of the limits that a result uses at most."""


class Motions:
    """Fourier motions of one duration, with the base's own and the torques they take.

    Args:
        robot: As the model believes it to be, true rotors locked.
        settings: `excitation` has limits and harmonics, `initial` the start.
        duration: [s].
        fine: How many times finer the times are at which limits are finally checked.
        others: The same robot with other wheels, whose limits count, too.

    Attributes:
        family: Motions at the nodes. fine: The same at finer times. start: Of the base.

    Raises:
        ConfigurationError: limits of the wrong length.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings,
        duration: float,
        *,
        fine: int = _FINE,
        others: Sequence[Robot] = (),
    ) -> None:
        options = settings.excitation
        self.settings, self.robot = settings, robot
        self.limits = Limits(robot, options)
        nodes = max(120, _NODES * options.harmonics)
        initial = initial_state(robot, settings.initial)
        times = np.linspace(0.0, duration, nodes + 1)
        self.family = MotionFamily(duration, options.harmonics, initial.q, times)
        self.fine = self.family.at(np.linspace(0.0, duration, fine * nodes + 1))
        self.start = BaseStart(initial.q_WB_xyzw, initial.omega_WB_B)
        self._bases = [BaseResponse(one) for one in (robot, *others)]

    def move(self, x: Array, family: MotionFamily) -> BaseMotion:
        """Motion of candidates x (B, size) at a family's times."""
        return self._bases[0].move(family.times, *family.motion(x), self.start)

    def moves(
        self, x: Array, family: MotionFamily, start: BaseStart | None = None
    ) -> list[BaseMotion]:
        """The same with the wheels assumed, then with the others; None: from the usual start."""
        joints = family.motion(x)
        return [base.move(family.times, *joints, start or self.start) for base in self._bases]

    def worst_use(self, x: Array, family: MotionFamily) -> Array:
        """(B,) largest use of any limit with any wheels; zero where nothing is limited."""
        uses = [_peaks(self.limits.fractions(motion)) for motion in self.moves(x, family)]
        return np.asarray(np.max([np.max(use, axis=1, initial=0.0) for use in uses], axis=0))

    def random(self, rng: np.random.Generator, use: float) -> Array:
        """(size,) a random motion, higher harmonics gentler, at so large a use of the limits."""
        x = rng.standard_normal((len(self.family.start), 2, self.family.harmonics))
        x /= np.arange(1, self.family.harmonics + 1)
        return self.scaled(x.ravel(), use, np.inf)

    def own(self) -> Array | None:
        """(size,) the robot file's own motion, as large as the limits allow; None without one."""
        reference = self.settings.reference
        if reference.kind != 'fourier':
            return None
        x = self.family.amplitudes(reference)
        return self.scaled(x, SAFE, 1.0) if np.any(x) else None

    def scaled(self, x: Array, use: float = SAFE, growth: float = 1.0) -> Array:
        """The motion with all amplitudes times the largest factor that keeps the limits.

        Args:
            x: (size,) amplitudes.
            use: Largest allowed fraction of any limit.
            growth: Largest factor; infinite: as large as the limits allow.

        Raises:
            ConfigurationError: none does.
        """
        if not np.isfinite(growth):
            x, growth = x / np.max(np.abs(x)), 2.0 * np.pi
        allowed = use
        for check in range(_CHECKS):
            scaled = self._largest_factor(x, allowed, growth) * x
            found = float(self.worst_use(scaled[None], self.fine)[0])
            if found <= use:
                return np.asarray(scaled)
            allowed *= (1.0 - 1e-5 * 4.0**check) * use / found
        reason = 'its limits leave no motion: the joints can not move at all'
        raise ConfigurationError('excitation', reason)

    def _largest_factor(self, x: Array, use: float, growth: float) -> float:
        """Largest factor up to the growth with which x keeps the limits at the nodes."""
        low, high = 0.0, growth
        for _ in range(_ROUNDS):
            factors = np.linspace(low, high, _LEVELS + 1)[1:]
            kept = self.worst_use(factors[:, None] * x, self.family) <= use
            if kept.all():
                return float(high)
            count = int(np.argmin(kept))
            low, high = (float(factors[count - 1]) if count else low), float(factors[count])
        return low


def _peaks(values: Array) -> Array:
    """(B, m) maxima over time of (B, T, m), those between two samples by a parabola."""
    middle = np.clip(np.argmax(values, axis=1), 1, values.shape[1] - 2)[:, None]
    before, at, after = (np.take_along_axis(values, middle + k, axis=1)[:, 0] for k in (-1, 0, 1))
    bend = 2.0 * at - before - after
    rise = (after - before) ** 2 / (8.0 * np.where(bend > 0.0, bend, np.inf))
    inside = np.abs(after - before) <= 2.0 * bend  # else the largest is at an end
    return np.where(inside, at + rise, np.max(values, axis=1))


_REFERENCE = ('kind', 'duration', 'harmonics', 'sine', 'cosine')


def write_trajectory(chosen: Chosen, template: str | Path, path: str | Path) -> Path:
    """Write the robot file with the designed `reference`, and the base rate that it starts from.

    Everything else is kept; a relative `robot.urdf` is rewritten to be found from the new place.

    Args:
        chosen: The motion.
        template: The robot file.
        path: The file to write.

    Raises:
        ConfigurationError: the template can't be read or the file can't be written.
    """
    template, path = Path(template), Path(path)
    values = dict(read_parameters(template))
    reference = asdict(chosen.family.reference(chosen.x))
    values['reference'] = {key: reference[key] for key in _REFERENCE}
    omega = chosen.start.omega.tolist()
    values['initial'] = {**(values.get('initial') or {}), 'angular_velocity': omega}
    urdf = str(values['robot'].get('urdf', ''))
    if urdf and '://' not in urdf and not Path(urdf).is_absolute():
        moved = os.path.relpath(template.parent / urdf, path.parent)
        values['robot'] = {**values['robot'], 'urdf': moved}
    head = (
        '# Identification motion from `spacerobot excite` (docs/excitation.md): reference and\n'
        f'# initial.angular_velocity are designed, the rest is as in {template.name}.\n'
    )
    return write_parameters(path, values, head)
