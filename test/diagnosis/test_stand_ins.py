"""What an effect out of the catalogue is taken for is not said to explain the data."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from support.lone_body import box_file

from spacerobot_ros.diagnosis.limits import CANCELLED, LITTLE
from spacerobot_ros.diagnosis.search.doubts import cancellation, doubts, drift_p, least_needed
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.columns import candidates
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.buffer import SampleBuffer
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from validation.hidden.diagnosis_campaign import HiddenCase
from validation.hidden.diagnosis_campaign import run as run_case
from validation.hidden.diagnosis_judge import is_equivalent
from validation.hidden.diagnosis_scenario import robot_file, simulated


@pytest.fixture(scope='module')
def run():
    """Return four seconds of the servicer, whose base hardly turns."""
    robot = robot_file('servicer').robot
    record = observed(simulated('servicer', 'slow', 5, (), 4.0), robot)
    return Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')


def test_values_that_drift_together_are_a_doubt(run):
    """A torque that changes its sign on the way; one that stays is what it is named."""
    kind = CATALOGUE['external_torque_body']
    fit = refine(run, [kind(name=kind.id, where=None, values={'x': 0.1, 'y': 0.1, 'z': 0.1})])
    assert drift_p(fit) > 0.05
    assert not list(doubts(fit, [1.0]))
    times = fit.rows.row_times
    column = fit.tangents[:, 0] * np.cos(np.pi * (times - times[0]) / np.ptp(times))
    drifting = copy(fit)
    drifting.data = fit.data + 16.0 * column / np.linalg.norm(column)
    assert 'drift' in next(doubts(drifting, [1.0]))


def test_torques_that_undo_each_other_or_are_too_large_are_a_doubt(run):
    def fit_of(**sizes):
        kinds = [(CATALOGUE[name], {'x': 0.0, 'y': y, 'z': 0.0}) for name, y in sizes.items()]
        return Fit(run, [kind(name=kind.id, where=None, values=v) for kind, v in kinds])

    apart = fit_of(external_torque_body=0.1, external_torque_inertial=-0.1)
    along = fit_of(external_torque_body=0.1, external_torque_inertial=0.1)
    assert cancellation(apart) > CANCELLED > cancellation(along)
    assert 'undo' in next(doubts(apart, [1.0, 1.0]))
    assert 'times as large as is plausible' in next(doubts(apart, [1.0, 7.0]))


def test_thrusters_against_each_other_are_what_they_are(tmp_path):
    """Both at 70 %, fired in turn: each takes what the other gave, and follows its own command."""
    mounted = {
        name: {'at': [0.0, 0.1, 0.0], 'direction': [sign, 0.0, 0.0], 'force': 0.02}
        for name, sign in (('A', 1.0), ('B', -1.0))
    }
    fired = {'width': 0.3, 'period': 2.0}
    firings = {
        'a': {'thruster': 'A', 'start': 0.5, **fired},
        'b': {'thruster': 'B', 'start': 1.0, **fired},
    }
    file = box_file(tmp_path, robot={'thrusters': mounted}, firings=firings)
    samples = SampleBuffer(())
    loop = ClosedLoop(file.robot, file.settings)
    for k, step in enumerate(loop.run(300)):
        samples.add_input('thrusters', ('A', 'B'), step.stamp_ns, loop.firings.commands(k))
        step.feed(samples)
    record = observed(in_robot_order(samples.record(), file.robot), file.robot)
    run = Run(record, file.robot, (), noise_levels(file.robot.sensors, record)[0], 'held_before')
    kind = CATALOGUE['thruster_gain']
    fit = Fit(run, [kind(name=name, where=name, values={'gain': 0.7}) for name in 'AB'])
    one, other = (fit.tangents @ fit.share(i) for i in range(2))
    assert one @ one + other @ other > CANCELLED * (one + other) @ (one + other)
    assert cancellation(fit) < CANCELLED


@pytest.mark.parametrize(
    ('strong', 'weak', 'is_doubt'),
    [(55.0, 9.0, True), (55.0, 22.0, False), (18.0, 9.0, False), (400.0, 9.0, False)],
)
def test_what_adds_little_to_the_others_may_be_what_a_wrong_name_left(run, strong, weak, is_doubt):
    """In standard deviations: two clear causes are two, and next to nothing is no doubt."""
    kinds = [CATALOGUE[name] for name in ('external_torque_body', 'gyro_bias')]
    unit = {'x': 1e-3, 'y': 0.0, 'z': 0.0}
    small = Fit(run, [kind(name=kind.id, where=None, values=unit) for kind in kinds])
    torque, bias = (small.tangents @ small.share(i) for i in range(2))
    others = small.tangents[:, small.own(0)]
    alone = bias - others @ np.linalg.lstsq(others, bias, rcond=None)[0]
    sizes = strong / np.linalg.norm(torque), weak / np.linalg.norm(alone)
    causes = [
        replace(cause, values={**cause.values, 'x': 1e-3 * size})
        for cause, size in zip(small.causes, sizes, strict=True)
    ]
    assert least_needed(Fit(run, causes)) == (1 if is_doubt else None)


def test_the_lesser_of_two_that_hide_a_third_effect_adds_little(run):
    """Columns alone: all pairs that leave no more of it than the test of fit lets pass."""
    clean, whole, unseen, least = Fit(run, ()), 1000.0, 36.0, 30.0  # in squares
    bases = {}
    for candidate in candidates(CATALOGUE.values(), clean.rows):
        # laws of a rate, of either sign, make each other
        if candidate.key in bases or candidate.kind.id == 'joint_friction_curvature':
            continue
        columns = clean.signatures.whitened(candidate.small_steps)
        columns = columns[:, np.any(columns, axis=0)]
        if columns.shape[1]:
            u, s, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
            bases[candidate.key] = u[:, s > 1e-6 * s[0]]
    added = []
    for hidden, truth in ((key, basis[:, 0]) for key, basis in bases.items()):
        others = {
            key: basis
            for key, basis in bases.items()
            if key[0] != hidden[0] and not is_equivalent(key, hidden)
        }
        left = {key: truth - basis @ (basis.T @ truth) for key, basis in others.items()}
        for one, other in permutations(others, 2):
            if not unseen <= whole * left[one] @ left[one] < 0.25 * whole:
                continue
            beside = others[other] - others[one] @ (others[one].T @ others[other])
            fitted = beside @ np.linalg.lstsq(beside, left[one], 1e-3)[0]
            both = left[one] @ left[one] - fitted @ fitted
            extra = min(fitted @ fitted, left[other] @ left[other] - both)
            if whole * both < unseen and whole * extra >= least:
                added.append(extra)
    assert len(added) > 30
    assert np.mean(np.array(added) < 0.5 * LITTLE) > 0.85


def test_an_effect_that_is_in_no_catalogue_is_not_explained():
    """Drag of the wheels, of which their momentum and a drag of the target's leave nothing."""
    case = HiddenCase(
        kind='left_out',
        robot='servicer',
        excitation='default',
        seed=13100,
        effects=('servicer_wheel_drag',),
        multiple=10.0,
    )
    assert run_case(case.key)['verdict'] == 'partly_explained'
