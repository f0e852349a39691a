"""The demonstration's report: what was found, how it converged, what it is good for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..display import (
    Curve,
    GoodOrBad,
    KeyFigure,
    KeyFigures,
    Panel,
    Plot,
    Replay,
    Report,
    Section,
    Table,
)
from ..identification.estimate import Estimate
from ..simulation.replay.scene import Arrow, Scene
from ..types import Array
from .results import (
    AIM_AAM_PERCENT,
    AIM_DRIFT,
    AIM_RATIO,
    DemoResults,
    DemoRun,
    momentum_percent,
)

AXES = 'xyz'


def _with_found(scene: Scene, estimate: Estimate) -> Scene:
    """The scene with the identified momentum at the links that hold it."""
    wheels = scene.robot.with_target_momentum(estimate.aam).target_wheels
    found = [Arrow(f'identified, {w.link}', w.body, w.body_momentum[None]) for w in wheels]
    words = ((w.body, f'wheels: {np.linalg.norm(w.momentum):.1f} N m s') for w in wheels)
    return replace(scene, arrows=(*found, *scene.arrows), marks=(*scene.marks, *words))


def demo_report(results: DemoResults, scene: Callable[[], Scene]) -> Report:
    """The page.

    Args:
        results: Of the demonstration.
        scene: Makes the scene of the recording of the run that identifies.
    """
    run = results.identification
    replay = Replay(
        lambda: _with_found(scene(), results.estimate),
        'A servicer has captured a satellite whose wheels still spin. Its arm moves under a '
        'controller that knows nothing of them, while the identifier listens to the noisy '
        'sensors. The orange ghost is where a model without them would be, beginning again from '
        'the measured state every two seconds. Then the same motion is tracked from the same '
        'start with what was identified.',
    )
    tracking = Plot(partial(_tracking, results), 'Reference minus true joint position.')
    kept = 'What a closed system keeps, and what the simulated one did while it was identified.'
    ledger = Plot(partial(_ledger, run), kept)
    return Report(
        title=results.answer,
        subtitle=f'robot {results.robot}, seed {results.seed}, simulated on ROS 2 nodes',
        sections=(
            Section('', [_figures(results), replay]),
            Section('Joint error with and without the wheel momentum', [tracking]),
            Section('Convergence of the estimates', _convergence(run, results.truth)),
            Section('Estimated parameters', [_parameters(results)]),
            Section('Momentum ledger', [ledger]),
        ),
    )


def demo_summary(results: DemoResults, out: Path) -> list[Section]:
    """What is printed: what was found, and where the rest lies."""
    estimate = results.estimate
    n = len(estimate.aam)
    std, truth = estimate.std[:n], results.truth[:n]
    percents = momentum_percent(estimate.aam - truth, truth)
    columns = _places(estimate), estimate.aam, 3.0 * std, truth, percents
    rows = [
        (place, f'{value:.4f}', f'{band:.4f}', f'{true:.4f}', f'{percent:+.3f}')
        for place, value, band, true, percent in zip(*columns, strict=True)
    ]
    lines = (
        f'largest joint error    {results.no_aam.max_error_deg:.3f} deg without, '
        f'{results.identified.max_error_deg:.4f} deg with it ({results.ratio:.0f} times smaller)',
        f'inertial parameters    within {results.parameter_error_percent:.3f} % of their largest',
        f'momentum drift         {results.momentum_drift:.1e} relative',
        f'wall time              {results.wall:.1f} s',
        f'report                 {out / "report.html"}',
        f'bags                   {", ".join(results.bags)}',
    )
    head = ('link, axis', 'estimate', '3 std', 'truth', 'error [%]')
    return [
        Section('Momentum of the captured wheels [N m s]', [Table(head, rows)]),
        Section('', lines),
    ]


def _places(estimate: Estimate) -> list[str]:
    return [f'{link}, {axis}' for link in estimate.aam_links for axis in AXES]


def _figures(results: DemoResults) -> KeyFigures:
    aam, ratio, drift = results.aam_error_percent, results.ratio, results.momentum_drift
    without, with_it = results.no_aam.max_error_deg, results.identified.max_error_deg
    rows = (
        ('error of the wheel momentum', f'{aam:.3g}', '%', f'aim: below {AIM_AAM_PERCENT:g} %'),
        ('largest joint error without it', f'{without:.3g}', 'deg', ''),
        (
            'largest joint error with it',
            f'{with_it:.2g}',
            'deg',
            f'{ratio:.0f} times smaller; aim: {AIM_RATIO:g} times',
        ),
        ('drift of the angular momentum', f'{drift:.1e}', '', f'aim: below {AIM_DRIFT:g}'),
    )
    reached = (aam < AIM_AAM_PERCENT, None, ratio > AIM_RATIO, drift < AIM_DRIFT)
    marks: dict[bool | None, GoodOrBad] = {True: 'good', False: 'bad', None: ''}
    return KeyFigures(
        [KeyFigure(*row, marks[is_so]) for row, is_so in zip(rows, reached, strict=True)]
    )


def _tracking(results: DemoResults) -> list[Panel]:
    runs = {'wheels unknown': results.no_aam, 'wheels identified': results.identified}

    def panel(title: str, joints: slice, log: bool = False) -> Panel:
        curves = [
            Curve(name, run.time, np.degrees(_largest(run.error[:, joints])))
            for name, run in runs.items()
        ]
        return Panel(title, 'deg', curves, log=log)

    single = [
        panel(f'error of {joint}', slice(j, j + 1)) for j, joint in enumerate(results.joints)
    ]
    return [panel('largest joint error', slice(None), log=True), *single]


def _largest(error: Array) -> Array:
    """(N,) entry of the largest magnitude of (N, k), with its sign."""
    at = np.argmax(np.abs(error), axis=1)[:, None]
    return np.take_along_axis(error, at, axis=1)[:, 0]


def _convergence(run: DemoRun, truth: Array) -> list[Plot]:
    estimates = [e for e in run.estimates if e.samples > 0]
    time = np.array([e.stamp_ns * 1e-9 for e in estimates])
    first = next((t for t, e in zip(time, estimates, strict=True) if e.valid), None)
    when = 'never' if first is None else f'{first:.1f} s after the start'
    values = np.array([e.aam for e in estimates])
    std = np.array([e.std[: e.aam.size] for e in estimates])
    places = _places(run.estimates[-1])
    truth = truth[: len(places)]

    def sizes() -> list[Panel]:
        relative = np.abs(momentum_percent(values - truth, truth))
        curves = [Curve(place, time, relative[:, i]) for i, place in enumerate(places)]
        return [Panel('error of the wheel momentum, of its size', '%', curves, log=True)]

    def late() -> list[Panel]:
        shown = time > 0.2 * time[-1]
        panels = []
        for i, place in enumerate(places):
            errors = Curve('', time[shown], (values[:, i] - truth[i])[shown], 3.0 * std[shown, i])
            title = f'{place}: estimate minus truth, and 3 standard deviations'
            panels.append(Panel(title, 'N m s', [errors], levels=[(0.0, 'truth')]))
        return panels

    return [
        Plot(sizes, f'The estimate is first given out as valid {when}.'),
        Plot(late, 'The last four fifths, on a scale that shows the bands.'),
    ]


def _parameters(results: DemoResults) -> Table:
    estimate = results.estimate
    momenta = [f'momentum {axis} of {link}' for link in estimate.aam_links for axis in AXES]
    names = [*momenta, *estimate.parameter_names]
    units = [*(['N m s'] * len(momenta)), *estimate.units]
    values = np.concatenate([estimate.aam, estimate.parameters])
    columns = names, values, estimate.std, results.truth, units
    rows = []
    for name, value, std, true, unit in zip(*columns, strict=True):
        percent = f'{100.0 * (value - true) / abs(true):.4f}' if true else '-'
        sigma = f'{(value - true) / std:.2f}' if std else '-'
        rows.append([name, f'{value:.6g}', f'{std:.2g}', f'{true:.6g}', percent, sigma, unit])
    head = ['parameter', 'estimate', 'std', 'truth', 'error [%]', 'error / std', 'unit']
    return Table(head, rows, 'Estimates at the end of the run')


def _ledger(run: DemoRun) -> list[Panel]:
    time = run.ledger_time
    momenta = [Curve(f'h {axis}', time, run.angular[:, i]) for i, axis in enumerate(AXES)]
    drift = Curve('', time, np.maximum(run.drift, 1e-17))
    aim = [(AIM_DRIFT, 'aim')]
    title = 'angular momentum about the centre of mass, inertial frame'
    return [
        Panel(title, 'N m s', momenta),
        Panel('relative drift of the angular momentum', '1', [drift], log=True, levels=aim),
        Panel('energy that no work accounts for', 'J', [Curve('', time, run.energy_drift)]),
    ]
