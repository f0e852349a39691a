"""Draw docs/images/demo.svg, the picture of README.md: `python docs/images/demo.py`."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'

import numpy as np
from matplotlib import pyplot as plt

from spacerobot_ros.demo.run import identify, track
from spacerobot_ros.effects.robot_file import load_robot_file
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
    plt.style.use(HERE / 'figures.mplstyle')
    figure, (tracking, identifying) = plt.subplots(2, 1, figsize=(8.0, 5.0), layout='constrained')
    for name, run in (('wheels unknown', no_aam), ('wheels identified', known)):
        error = np.degrees(np.abs(run.error).max(axis=1))
        tracking.semilogy(run.time[::EVERY], error[::EVERY], label=name)
    tracking.set(title='tracking: largest joint error', ylabel='[deg]')
    shown = [
        e
        for e in found.estimates
        if e.samples > 0 and e.stamp_ns > 0.25 * found.estimates[-1].stamp_ns
    ]
    time = np.array([e.stamp_ns * 1e-9 for e in shown])
    for i, axis in enumerate('xyz'):
        error = np.array([e.aam[i] - truth[i] for e in shown])
        band = np.array([3.0 * e.std[i] for e in shown])
        (line,) = identifying.plot(time, error, label=f'{axis} ({truth[i]:g})')
        identifying.fill_between(
            time, error - band, error + band, color=line.get_color(), alpha=0.18, linewidth=0
        )
    title = 'identifying: error of the wheel momentum, 3 std'
    identifying.set(title=title, ylabel='[N m s]', xlabel='time [s]')
    for ax in (tracking, identifying):
        ax.legend(loc='lower right', bbox_to_anchor=(1.0, 0.98), ncols=3)
    figure.savefig(HERE / 'demo.svg', metadata={'Date': None})


def _ignore(done: float) -> None:
    """No progress is shown."""


if __name__ == '__main__':
    main()
