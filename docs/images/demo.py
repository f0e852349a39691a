"""Draw docs/images/demo.svg, the picture of README.md: `python docs/images/demo.py`."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'

import numpy as np

from spacerobot_ros.demo.results import DemoRun
from spacerobot_ros.demo.run import identify, track
from spacerobot_ros.display import Curve, Panel
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.report.plots import plot
from spacerobot_ros.simulation.truth import true_robot

HERE = Path(__file__).parent
EVERY = 10  # samples; keeps the file small


def main() -> None:
    """Run what `make demo` runs, and draw its joint errors and estimates."""
    file = load_robot_file(HERE.parents[1] / 'config' / 'servicer.yaml')
    truth = true_robot(file.robot, file.settings).target_momentum
    with tempfile.TemporaryDirectory() as folder:
        found = identify(file, 2, [Path(folder, 'a')], _ignore)
        known = track(file, found.estimates[-1], Path(folder, 'b'))
    no_aam = found.until(file.settings.reference.duration)
    picture = plot([_tracking(no_aam, known), _convergence(found, truth)])
    (HERE / 'demo.svg').write_text(picture + '\n', encoding='utf-8')


def _tracking(no_aam: DemoRun, known: DemoRun) -> Panel:
    curves = [
        Curve(name, run.time[::EVERY], np.degrees(np.abs(run.error).max(axis=1))[::EVERY])
        for name, run in (('wheels unknown', no_aam), ('wheels identified', known))
    ]
    return Panel('tracking: largest joint error', 'deg', curves, log=True)


def _convergence(found: DemoRun, truth: np.ndarray) -> Panel:
    last = found.estimates[-1].stamp_ns
    shown = [e for e in found.estimates if e.samples > 0 and e.stamp_ns > 0.25 * last]
    time = np.array([e.stamp_ns * 1e-9 for e in shown])
    curves = [
        Curve(
            f'{axis} ({truth[i]:g})',
            time,
            np.array([e.aam[i] - truth[i] for e in shown]),
            np.array([3.0 * e.std[i] for e in shown]),
        )
        for i, axis in enumerate('xyz')
    ]
    return Panel('identifying: error of the wheel momentum, 3 std', 'N m s', curves)


def _ignore(done: float) -> None:
    """No progress is shown."""


if __name__ == '__main__':
    main()
