"""The parameters that the adaptive laws know by name, and the regressors linear in them."""

from __future__ import annotations

import numpy as np

from ...dynamics.body_regressors import WHEELS, Regression, fill_momentum, fill_slotine_li
from ...dynamics.tree import LINK, inertial_rows, tree_of
from ...errors import ConfigurationError
from ...model.robot import Gyrostat, Robot
from ...types import Array

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
