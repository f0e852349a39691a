"""Compile what every start would: `python -m spacerobot_ros.campaign.warm_up [kernels|modules]`.

Python compiles a module when it is first imported, numba a kernel when it is first called; both
keep the result in a file. `modules` imports all of the package, and with them all that they use,
once its messages are built. `kernels` needs no ROS: it works in two processes, one of which calls
the kernels of fits, whose arguments are easily made up, while the other simulates, identifies and
at last diagnoses a short record. What calls a kernel compiles the `inner` ones below it, which
both halves do of some; no kernel is compiled twice.
"""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numba.core import event

from .. import __path__ as package_path
from ..diagnosis.diagnose import diagnose
from ..diagnosis.flight.wheel_momentum import constant_pass
from ..dynamics.forward_kinematics import BodyKinematics
from ..dynamics.rnea_derivatives import rnea_derivatives
from ..dynamics.tree import tree_of
from ..effects.catalogue import CATALOGUE, bind_effect
from ..effects.laws.hysteresis import followed
from ..effects.own_states import driven_states
from ..errors import IdentificationError
from ..estimation.filters.kalman import StateSpace, correlate, gains_of, whiten
from ..estimation.trajectory.base_response import BaseResponse, BaseStart
from ..identification.batch import identify_robot
from ..model.robot import Robot
from .hidden.diagnosis_scenario import robot_file, simulated

_DURATION = 3.0  # s
_KINDS = (
    'fuel_slosh',
    'joint_viscous_friction',
    'joint_presliding_friction',
    'joint_torque_ripple',
)


class _Progress(event.Listener):  # type: ignore[misc]  # numba is untyped
    """Says on a terminal which function is compiled."""

    def __init__(self) -> None:
        self._names: list[str] = []

    def on_start(self, compiled: event.Event) -> None:
        """Show the outermost: those that it calls are part of it."""
        self._names.append(compiled.data['dispatcher'].py_func.__qualname__)
        if len(self._names) == 1:
            _show(f'kernel {self._names[0]}')

    def on_end(self, compiled: event.Event) -> None:
        """Go back to the one that called it."""
        self._names.pop()


def _show(line: str) -> None:
    """A line in place of the one before it; nothing where nobody looks."""
    if sys.stdout.isatty():
        sys.stdout.write(f'\r\x1b[K{line}')
        sys.stdout.flush()


def call_fits(robot: Robot) -> None:
    """Call what linearizes, filters and follows a motion, with zeros of the right shapes."""
    tree, n = tree_of(robot), robot.n_joints
    places, motions = np.zeros((1, n + 1, 3)), np.zeros((1, n + 1, 6))
    kinematics = BodyKinematics(np.zeros((1, n + 1, 3, 3)), places, motions, motions)
    rnea_derivatives(tree, kinematics, motions)
    step, whole = np.eye(2)[None], np.zeros(1, dtype=np.int64)
    rows = (np.array([0, 1, 1]), whole, np.zeros((0, 2)), np.ones(1))
    handed, fresh = np.zeros((1, 0), dtype=np.int64), np.zeros((1, 0))
    model = StateSpace(np.ones(1), step, step, handed, fresh, 1, *rows)
    gains = gains_of(model, np.eye(2))
    mean, rates, measured = np.zeros((2, 1)), np.zeros((2, 1, 1)), np.zeros((1, 1))
    whiten(model, gains, mean, rates, np.zeros((0, 0)), measured)
    correlate(model, gains, np.zeros(1), 1)
    start = BaseStart(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    still = np.zeros((1, 5, n))
    BaseResponse(robot).move(np.arange(5.0), still, still, still, start)
    driven_states(lambda x: -x, np.arange(2.0), 1)
    followed(np.zeros(2), 1.0, is_dahl=True)
    constant_pass(*[np.zeros((1, 1)) for _ in range(4)])


def call_rest(robot: Robot, wait: Callable[[], object] = lambda: None) -> None:
    """Simulate, identify and, when the fits' kernels are there, diagnose.

    Args:
        robot: The servicer.
        wait: Returns when they are.
    """
    fuel = {'mass': 60.0, 'frequency': 3.0, 'damping': 0.05}
    slosh = bind_effect('hidden_0', 'fuel_slosh', 'base_link', fuel, robot)
    simulated('servicer', 'fast', 1, [], _DURATION)  # kernels of its own without effects
    record = simulated('servicer', 'fast', 1, [slosh], _DURATION)
    wait()
    with suppress(IdentificationError):  # too short to be told much by
        identify_robot(record, robot, robot_file('servicer').settings.identifier)
    diagnose(record, robot, catalogue=[CATALOGUE[kind] for kind in _KINDS])


def _kernels() -> None:
    event.register('numba:compile', _Progress())
    robot = robot_file('servicer').robot
    beside = subprocess.Popen([sys.executable, '-m', __spec__.name, 'fits'])
    try:
        call_rest(robot, beside.wait)
    finally:
        beside.kill()
        beside.wait()
    _show('')


def _fits() -> None:
    event.register('numba:compile', _Progress())
    call_fits(robot_file('servicer').robot)


def _modules() -> None:
    for module in pkgutil.walk_packages(package_path, 'spacerobot_ros.'):
        _show(f'module {module.name}')
        with suppress(ImportError):  # nodes, where there is no ROS 2
            importlib.import_module(module.name)
    _show('')


PARTS = {'kernels': _kernels, 'fits': _fits, 'modules': _modules}

if __name__ == '__main__':
    for name in sys.argv[1:] or ('kernels', 'modules'):
        PARTS[name]()
