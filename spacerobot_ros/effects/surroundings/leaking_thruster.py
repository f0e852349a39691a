"""Thrusters that push where nobody fires them: a leak, pulses."""

from __future__ import annotations

import math

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..motion import Motion
from ..parameter import searched, xyz
from .environment import AT, FORCE, External

_RISE = 5e-3
"""Time in which a thruster's valve opens or closes [s]."""


class Thruster(External):
    """A force f in base coordinates at a point r from the base origin: torque r x f.

    Source: Wertz, Spacecraft Attitude Determination and Control, 17.4.

    Args:
        force_x, force_y, force_z: Force along the base's axes.
        at_x, at_y, at_z: Where it acts, along the base's axes from the base origin.
    """

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque."""
        return self.force_at(motion, self.vector(*FORCE))


_AT = tuple(searched(name, 'm', 1.0, default=0.0, guesses=(-1.0, 1.0)) for name in AT)


class ThrusterLeak(Thruster):
    """A force that is constant in the base.

    Typical: 1 mN to 1 N.
    Signature: a torque on the base that follows the centre of mass as the arm moves.
    """

    id = 'thruster_leak'
    title = 'thruster that leaks'
    parameters = (*xyz('N', 1.0, 1e-3, 'force_'), *_AT)


class ThrusterPulses(Thruster):
    """The force of a leak, on for `width` in every `period` from `start` on.

    The valve opens and closes along half a cosine; a pulse's impulse is exactly f * width.

    Typical: 1 to 20 N for 5 to 100 ms.
    Signature: steps of the momentum, all alike.

    Args:
        period: Time from one pulse to the next.
        width: Time for which a pulse is on.
        start: When the first pulse comes.
    """

    id = 'thruster_pulses'
    title = 'thruster that fires in pulses'
    is_timed = True
    is_fitted = False
    parameters = (
        *xyz('N', 10.0, 0.01, 'force_'),
        *_AT,
        searched('period', 's', above=0.0, nominal=1.0, guesses=(0.1, 1.0, 10.0)),
        searched('width', 's', minimum=_RISE, nominal=0.02, guesses=(0.02, 0.1)),
        searched('start', 's', default=0.0, minimum=0.0, guesses=(0.0,)),
    )

    def check(self, robot: Robot) -> None:
        """Refuse pulses that run into each other."""
        if self['width'] + _RISE > self['period']:
            raise self.refusal(
                f'{self["width"]:g} s and {_RISE:g} s to open and close do not fit into '
                f'a period of {self["period"]:g} s',
                'width',
            )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque while the valve is open."""
        return self._opening(motion.time)[:, None] * super().force(motion, hidden)

    def fastest(self, robot: Robot) -> float:
        """The valve's."""
        return math.pi / _RISE

    def _opening(self, time: Array) -> Array:
        since = time - self['start']
        phase = np.where(since >= 0.0, np.mod(since, self['period']), math.inf)
        opened = np.clip(phase / _RISE, 0.0, 1.0)
        closed = np.clip((phase - self['width']) / _RISE, 0.0, 1.0)
        return np.asarray(0.5 * (np.cos(np.pi * closed) - np.cos(np.pi * opened)))
