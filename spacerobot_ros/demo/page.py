"""The demonstration's report: what was found, how it converged, what it is good for."""

from __future__ import annotations

import numpy as np

from ..display import Curve, Item, KeyFigure, KeyFigures, Panel, Plot, Report, Section, Table, Text
from ..report.plots import plot
from .results import Results

AIM_AAM_PERCENT = 1.0
AIM_RATIO = 50.0
AIM_DRIFT = 1e-10
AXES = 'xyz'


def demo_report(results: Results) -> Report:
    """The report as data for `report.html.write_report`."""
    return Report(
        title='Wheel momentum of a captured satellite: identified and used',
        subtitle=f'robot {results.robot}, seed {results.seed}, simulated on ROS 2 nodes',
        sections=(
            Section('Result', _figures(results)),
            Section('Joint error with and without the wheel momentum', _tracking(results)),
            Section('Convergence of the estimates', _convergence(results)),
            Section('Estimated parameters', [_parameters(results)]),
            Section('Momentum ledger', _ledger(results)),
        ),
    )


def _figures(results: Results) -> list[Item]:
    ratio = results.no_aam.max_error_deg / results.identified.max_error_deg
    aam, drift = results.aam_error_percent, results.momentum_drift
    figures = [
        KeyFigure(
            'error of the wheel momentum',
            f'{aam:.3g}',
            '%',
            f'aim: below {AIM_AAM_PERCENT:g} %',
            'good' if aam < AIM_AAM_PERCENT else 'bad',
        ),
        KeyFigure('largest joint error without it', f'{results.no_aam.max_error_deg:.3g}', 'deg'),
        KeyFigure(
            'largest joint error with it',
            f'{results.identified.max_error_deg:.2g}',
            'deg',
            f'{ratio:.0f} times smaller; aim: {AIM_RATIO:g} times',
            'good' if ratio > AIM_RATIO else 'bad',
        ),
        KeyFigure(
            'drift of the angular momentum',
            f'{drift:.1e}',
            '',
            f'aim: below {AIM_DRIFT:g}',
            'good' if drift < AIM_DRIFT else 'bad',
        ),
    ]
    return [
        KeyFigures(figures),
        Text(
            'A servicer has captured a satellite whose wheels still spin. First the arm moves '
            'under a controller that knows nothing of them, while the identifier listens to the '
            'noisy sensors; then the same motion is tracked twice from the same start, without '
            'and with what was identified.'
        ),
    ]


def _tracking(results: Results) -> list[Item]:
    def curves(run: str, name: str) -> Curve:
        r = getattr(results, run)
        return Curve(name, r.time, np.degrees(np.abs(r.error).max(axis=1)))

    both = Panel(
        'largest joint error',
        'deg',
        [curves('no_aam', 'wheels unknown'), curves('identified', 'wheels identified')],
        log=True,
    )
    single = [
        Panel(
            f'error of joint {joint + 1}',
            'deg',
            [
                Curve('wheels unknown', results.no_aam.time, degrees(results.no_aam.error, joint)),
                Curve(
                    'wheels identified',
                    results.identified.time,
                    degrees(results.identified.error, joint),
                ),
            ],
        )
        for joint in range(results.no_aam.error.shape[1])
    ]
    return [Plot(plot([both, *single]), 'Reference minus true joint position.')]


def degrees(error: np.ndarray, joint: int) -> np.ndarray:
    """One joint's error [deg]."""
    return np.asarray(np.degrees(error[:, joint]))


def _convergence(results: Results) -> list[Item]:
    estimates = [e for e in results.identification.estimates if e.samples > 0]
    time = np.array([e.stamp_ns * 1e-9 for e in estimates])
    values = np.array([e.aam for e in estimates])
    std = np.array([e.std[: len(e.aam)] for e in estimates])
    truth = results.truth.aam
    links = results.estimate.aam_links
    panels = [
        Panel(
            f'{links[i // 3]}, {AXES[i % 3]}: estimate minus truth, and 3 standard deviations',
            'N m s',
            [Curve('', time, values[:, i] - truth[i], 3.0 * std[:, i])],
            levels=[(0.0, 'truth')],
        )
        for i in range(len(truth))
    ]
    relative = 100.0 * np.abs(values - truth) / np.abs(truth)
    sizes = Panel(
        'error of the wheel momentum',
        '%',
        [Curve(f'{links[i // 3]} {AXES[i % 3]}', time, relative[:, i]) for i in range(len(truth))],
        log=True,
    )
    first = next((t for t, e in zip(time, estimates, strict=True) if e.valid), None)
    said = 'never' if first is None else f'{first:.1f} s after the start'
    settled = time > 0.2 * time[-1]
    late = [
        Panel(p.title, p.unit, [_cut(c, settled) for c in p.curves], levels=p.levels)
        for p in panels
    ]
    return [
        Plot(plot([sizes]), f'The estimate is first given out as valid {said}.'),
        Plot(plot(late), 'The last four fifths, on a scale that shows the bands.'),
    ]


def _cut(curve: Curve, chosen: np.ndarray) -> Curve:
    band = None if curve.half_band is None else curve.half_band[chosen]
    return Curve(curve.label, curve.t[chosen], curve.y[chosen], band)


def _parameters(results: Results) -> Table:
    estimate, truth = results.estimate, results.truth
    names = [f'momentum {AXES[i % 3]} of {link}' for link in estimate.aam_links for i in range(3)]
    names += list(estimate.parameter_names)
    units = ['N m s'] * len(estimate.aam) + ['kg m^2'] * len(estimate.parameters)
    values = np.concatenate([estimate.aam, estimate.parameters])
    truths = np.concatenate([truth.aam, truth.parameters])
    rows = []
    for name, unit, value, std, true in zip(
        names, units, values, estimate.std, truths, strict=True
    ):
        percent = f'{100.0 * (value - true) / abs(true):.4f}' if true else '-'
        sigma = f'{(value - true) / std:.2f}' if std else '-'
        rows.append([name, f'{value:.6g}', f'{std:.2g}', f'{true:.6g}', percent, sigma, unit])
    head = ['parameter', 'estimate', 'std', 'truth', 'error [%]', 'error / std', 'unit']
    return Table(head, rows, 'Estimates at the end of the run')


def _ledger(results: Results) -> list[Item]:
    run = results.identification
    momentum = Panel(
        'angular momentum about the centre of mass, inertial frame',
        'N m s',
        [Curve(f'h {AXES[i]}', run.ledger_time, run.angular[:, i]) for i in range(3)],
    )
    drift = Panel(
        'relative drift of the angular momentum',
        '1',
        [Curve('', run.ledger_time, np.maximum(run.drift, 1e-17))],
        log=True,
        levels=[(AIM_DRIFT, 'aim')],
    )
    energy = Panel(
        'energy that no work accounts for', 'J', [Curve('', run.ledger_time, run.energy_drift)]
    )
    caption = 'What a closed system keeps, and what the simulated one did while it was identified.'
    return [Plot(plot([momentum, drift, energy]), caption)]
