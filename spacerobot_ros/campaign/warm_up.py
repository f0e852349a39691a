"""Compile what every start would: `python -m spacerobot_ros.campaign.warm_up`.

Python compiles a module when it is first imported, numba a kernel when it is first called; both
keep the result in a file. So all modules of the package are imported here, and with them all that
they use, and a short simulated record with fuel that sloshes is diagnosed, which calls the
kernels.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from contextlib import suppress

from numba.core import event

from .. import __path__ as package_path
from ..diagnosis.diagnose import diagnose
from ..effects.catalogue import bind_effect
from .diagnosis_scenario import robot_file, simulated

_DURATION = 3.0  # s


class _Progress(event.Listener):  # type: ignore[misc]  # numba is untyped
    """Says on a terminal which function is compiled."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self.count = 0

    def on_start(self, compiled: event.Event) -> None:
        """Show the outermost: those that it calls are part of it."""
        self._names.append(compiled.data['dispatcher'].py_func.__qualname__)
        if len(self._names) == 1:
            self.count += 1
            _show(f'kernel {self.count}: {self._names[0]}')

    def on_end(self, compiled: event.Event) -> None:
        """Go back to the one that called it."""
        self._names.pop()


def _show(line: str) -> None:
    """A line in place of the one before it; nothing where nobody looks."""
    if sys.stdout.isatty():
        sys.stdout.write(f'\r\x1b[K{line}')
        sys.stdout.flush()


def main() -> None:
    """Import every module and call every kernel once."""
    for module in pkgutil.walk_packages(package_path, 'spacerobot_ros.'):
        _show(f'module {module.name}')
        with suppress(ImportError):  # nodes, where there is no ROS 2
            importlib.import_module(module.name)
    event.register('numba:compile', _Progress())
    robot = robot_file('servicer').robot
    fuel = {'mass': 60.0, 'frequency': 3.0, 'damping': 0.05}
    friction = {'coefficient': 5.0}
    hidden = [
        bind_effect('hidden_0', 'fuel_slosh', 'base_link', fuel, robot),
        bind_effect('hidden_1', 'joint_viscous_friction', 'joint_2', friction, robot),
    ]
    diagnose(simulated('servicer', 'fast', 1, hidden, _DURATION), robot)
    _show('')


if __name__ == '__main__':
    main()
