"""Compile the numerical kernels: `python -m spacerobot_ros.campaign.warm_up`.

Numba compiles a kernel when it is first called and keeps the result beside its file. A short
simulated record with fuel that sloshes, diagnosed, calls them all, so that nobody
waits for them later.
"""

from __future__ import annotations

from ..diagnosis.diagnose import diagnose
from ..effects.catalogue import bind_effect
from .diagnosis_scenario import robot_file, simulated

_DURATION = 3.0  # s


def main() -> None:
    """Call every kernel once."""
    robot = robot_file('servicer').robot
    fuel = {'mass': 60.0, 'frequency': 3.0, 'damping': 0.05}
    friction = {'coefficient': 5.0}
    hidden = [
        bind_effect('hidden_0', 'fuel_slosh', 'base_link', fuel, robot),
        bind_effect('hidden_1', 'joint_viscous_friction', 'joint_2', friction, robot),
    ]
    diagnose(simulated('servicer', 'fast', 1, hidden, _DURATION), robot)


if __name__ == '__main__':
    main()
