"""A flight's rows as a linear problem about a fit, and the moves from one fit to the next."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.search.conclusion import conclude
from spacerobot_ros.diagnosis.search.linear_rows import CandidateColumns, LinearRows, variant_of
from spacerobot_ros.diagnosis.search.search import RelinearizedSearch
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.model_search import best_set
from validation.hidden.diagnosis_scenario import robot_file, simulated

FRICTION, TRUTH = 'joint_viscous_friction', 1.0
KINDS = [CATALOGUE[e] for e in (FRICTION, 'joint_coulomb_friction', 'inertial_parameters')]


@pytest.fixture(scope='module')
def run():
    """Return six seconds of the servicer with viscous friction in its second joint."""
    robot = robot_file('servicer').robot
    hidden = bind_effect('hidden', FRICTION, 'joint_2', {'coefficient': TRUTH}, robot)
    record = observed(simulated('servicer', 'default', 3, [hidden], 6.0), robot)
    return Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')


@pytest.fixture(scope='module')
def null(run):
    """Return the model as it stands with its candidates."""
    fit = Fit(run, ())
    return LinearRows(fit, CandidateColumns.of(fit, KINDS))


def test_what_a_fit_has_stands_by_its_tangents(run, null):
    """The same set, values and evidence about both, where what is hidden is all but linear."""
    _, guess = null.alone()[0]
    ahead = LinearRows(refine(run, [guess]), null.columns)
    np.testing.assert_allclose(ahead.data, null.data, rtol=0.0, atol=0.05)  # of a deviation
    values = []
    for now in (null, ahead):
        about = Hypotheses(now.blocks(now.data), now.hypotheses)
        found = best_set(about)
        (chosen,) = (about.every[i] for i in found.chosen)
        assert variant_of(chosen).key == (FRICTION, 'joint_2')
        values.append(about.mean(found.marginal, found.chosen)[chosen.columns[0]])
    assert values[1] == pytest.approx(values[0], rel=0.01)


def test_other_data_stand_in_the_same_columns(null):
    about = Hypotheses(null.blocks(null.data), null.hypotheses)
    data = -0.5 * null.data
    by_copy = best_set(about.with_data(null.blocks(data)))
    anew = best_set(Hypotheses(null.blocks(data), null.hypotheses))
    assert by_copy.objective == pytest.approx(anew.objective, abs=1e-9)
    assert by_copy.chosen == anew.chosen


def test_a_candidate_for_a_body_is_added_to_the_file_s(run, null):
    every = {variant_of(h).key: h for h in null.hypotheses}
    body = every['inertial_parameters', 'link_3'].body
    k = [b.name for b in run.robot.bodies].index('link_3')
    np.testing.assert_array_equal(body.file, run.robot.inertial_parameters[k])
    assert every[FRICTION, 'joint_1'].body is None


def test_one_hidden_cause_is_found_with_its_value(run):
    found = RelinearizedSearch(run, KINDS, lambda what, share: None).find()
    (cause,) = found.fit.causes
    assert cause.key == (FRICTION, 'joint_2')
    assert abs(cause['coefficient'] - TRUTH) < 4.0 * found.deviations[0]
    assert found.is_good
    assert found.gain > found.causes[0].log_odds > 0.0
    assert found.only([]).causes == ()


def test_without_candidates_nothing_is_found(run):
    found = RelinearizedSearch(run, [], lambda what, share: None).find()
    assert found.fit.causes == ()
    assert found.gain == 0.0
    said = conclude(found, ('note',))
    assert (said.verdict, said.causes, said.covariance) == ('unexplained', (), None)
    assert said.notes == ('note',)


def test_what_is_said_of_one_cause(run):
    """Errors by the noise, with the values of other parts: one, where nothing is left."""
    found = RelinearizedSearch(run, KINDS, lambda what, share: None).find()
    said = conclude(found, ())
    assert said.verdict == 'explained', said.sentence
    assert said.gain.before > 1.2
    assert said.gain.after == pytest.approx(1.0, abs=0.05)  # some 5000 rows: five deviations
    (cause,) = said.causes
    assert 0.9 < cause.evidence.held_out_gain <= 1.0
    assert cause.evidence.elpd_gain > 100.0
    assert said.covariance.names == (f'{FRICTION}/joint_2/coefficient',)
    std = cause.parameters['coefficient'].std
    np.testing.assert_allclose(said.covariance.matrix, [[std**2]], rtol=1e-9)
