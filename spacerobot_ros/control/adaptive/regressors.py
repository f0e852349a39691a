"""The parameters that the adaptive laws know by name, and torques linear in them, T = F pi."""

from __future__ import annotations

import numpy as np

from ...dynamics.body_regressors import (
    WHEELS,
    Regression,
    fill_momentum,
    fill_resting_momentum,
    fill_slotine_li,
    momentum_map,
    rest_centre,
)
from ...dynamics.tree import LINK, inertial_rows, tree_of
from ...errors import ConfigurationError
from ...model.robot import Gyrostat, Robot
from ...types import Array
from .learning_kernel import filter_step

BODY_NAMES = ('m', 'mcx', 'mcy', 'mcz', 'Ixx', 'Ixy', 'Iyy', 'Ixz', 'Iyz', 'Izz')
_BODY_UNITS = ('kg', *('kg m',) * 3, *('kg m^2',) * 6)


class Regressors:
    """Regressors of one robot; keeps scratch memory, so one object serves one thread.

    Args:
        robot: Free-flying robot; only its tree and the places of its wheels matter.

    Attributes:
        machine: What the compiled functions of `dynamics.body_regressors` take.
        shape: 6 + n rows, and p columns: ten a body and three a link with wheels.

    Raises:
        ConfigurationError: fixed base, or free rotors (give the gyrostat view).
    """

    def __init__(self, robot: Robot) -> None:
        if not robot.is_free:
            raise ConfigurationError('robot.base', 'adaptive laws control a free-flying base')
        if robot.rotor_count:
            why = 'adaptive laws take the model with locked rotors (gyrostat view)'
            raise ConfigurationError('robot', why)
        bodies = len(robot.bodies)
        wheels = np.zeros(len(wheel_links(robot)), WHEELS)
        for record, g in zip(wheels, wheel_links(robot), strict=True):
            record['body'], record['rotation'] = g.body, g.rotation
        links = (np.zeros(bodies, LINK), np.zeros(bodies, LINK))
        self.machine: Regression = (tree_of(robot).copy(), wheels, *links)
        self.shape = (5 + bodies, 10 * bodies + 3 * len(wheels))

    def slotine_li(self, q: Array, V: Array, Vr: Array, Ar: Array) -> Array:
        """(6 + n, p) Slotine-Li regressor; arguments as `fill_slotine_li`."""
        Y = np.zeros(self.shape)
        fill_slotine_li(self.machine, *(np.array(x, dtype=float) for x in (q, V, Vr, Ar)), Y)
        return Y

    def momentum(self, q: Array, V: Array) -> tuple[Array, Array]:
        """(6 + n, p) twice: the momentum regressors Yp and Yc of `fill_momentum`."""
        Yp, Yc = np.zeros(self.shape), np.zeros(self.shape)
        fill_momentum(self.machine, np.array(q, dtype=float), np.array(V, dtype=float), Yp, Yc)
        return Yp, Yc


def wheel_links(robot: Robot) -> tuple[Gyrostat, ...]:
    """Gyrostats that have columns: the servicer's where it spins, and all of the captured body."""
    own = (robot.servicer_wheels,) if robot.servicer_wheels.momentum.any() else ()
    return (*own, *robot.target_wheels)


def parameter_values(robot: Robot) -> Array:
    """(p,) inertial parameters of all bodies, then wheel momenta, of a robot."""
    momenta = [g.momentum for g in wheel_links(robot)]
    return np.concatenate([inertial_rows(robot).ravel(), *momenta])


def parameter_names(robot: Robot) -> tuple[str, ...]:
    """Names as `link_1.Ixx` and `link_3.aam_x`, in the order of `parameter_values`."""
    names = [f'{body.name}.{name}' for body in robot.bodies for name in BODY_NAMES]
    names += [f'{g.link}.aam_{axis}' for g in wheel_links(robot) for axis in 'xyz']
    return tuple(names)


def parameter_units(robot: Robot) -> tuple[str, ...]:
    """Units in the order of `parameter_values`."""
    return (*_BODY_UNITS * len(robot.bodies), *('N m s',) * (3 * len(wheel_links(robot))))


def with_parameters(robot: Robot, values: Array) -> Robot:
    """The robot with other parameters (p,); not checked for physical consistency."""
    n = 10 * len(robot.bodies)
    out = robot.with_inertial_parameters(values[:n].reshape(-1, 10))
    own = len(wheel_links(robot)) - len(robot.target_wheels)
    return out.with_target_momentum(values[n + 3 * own :])


class FilteredMomentum:
    """Low-passed momentum balance: ten rows and more without any acceleration (learning_kernel).

    Args:
        regressors: Of the robot.
        rate: Corner of the low-pass [1/s].
    """

    def __init__(self, regressors: Regressors, rate: float) -> None:
        self._machine, self._rate = regressors.machine, rate
        shape = regressors.shape
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._stages = np.zeros(shape), np.zeros(shape[0]), self.F, self.T
        self._now, self._before = [(np.zeros(shape), np.zeros(shape)) for _ in range(2)]
        self._P = np.zeros((3, shape[0]))
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        for array in self._stages:
            array[:] = 0.0
        self._is_fresh = True

    def add(self, q: Array, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample.

        Args:
            q: (n,) joint positions.
            V: (6 + n,) velocity at the sample; its linear part is written unless it is measured.
            u: (6 + n,) torques applied since the sample before.
            h: Time since then [s].
            pi: (p,) parameters that a predicted base velocity was computed with.
            measured: Whether V's linear part is; if not, the translation is eliminated and the
                force rows are zero.

        Returns:
            Whether F and T hold a whole interval.
        """
        if measured:
            fill_momentum(self._machine, q, V, *self._now)
        else:
            fill_resting_momentum(self._machine, q, V, pi, self._P, self._now)
        if self._is_fresh:
            for kept, now in zip(self._before, self._now, strict=True):
                kept[:] = now
            self._is_fresh = False
            return False
        filter_step(self._rate, h, u, self._now, self._before, self._stages)
        return True


class DifferencedRates:
    """The paper's rows: Y(q, V, V') pi = u with accelerations as differences of the rates.

    The force rows are left out, so the base's mass has no effect. Takes the same calls as
    `FilteredMomentum`; `pi` predicts the base's velocity in the middle of the interval.
    """

    def __init__(self, regressors: Regressors) -> None:
        self._machine, shape = regressors.machine, regressors.shape
        self._P = np.zeros((3, shape[0]))
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._before = np.zeros(shape[0])
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        self._is_fresh = True

    def add(self, q: Array, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample, as `FilteredMomentum.add`."""
        momentum_map(self._machine, q, V, pi, self._P)
        if not measured:
            rest_centre(self._P, V)
        if self._is_fresh:
            self._before[:] = V
            self._is_fresh = False
            return False
        A = (V - self._before) / h
        middle = 0.5 * (V + self._before)
        if not measured:
            rest_centre(self._P, middle)
        fill_slotine_li(self._machine, q, middle, middle, A, self.F)
        self.F[:3] = 0.0
        self.T[3:] = u[3:]
        self._before[:] = V
        return True
