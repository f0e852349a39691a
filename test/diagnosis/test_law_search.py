"""What a search for laws takes for noise, and what it leaves to causes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.discovery import screen as screens
from spacerobot_ros.diagnosis.discovery.arm_motions import ArmMotions
from spacerobot_ros.diagnosis.discovery.discover import doubt
from spacerobot_ros.diagnosis.discovery.possible_laws import Extent, Law, joint_laws
from spacerobot_ros.diagnosis.discovery.screen import JointScreen, chance_of
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.laws.grammar import FORMS
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.balance.leftover import VARIANCES, JointRows
from spacerobot_ros.estimation.inference.spectral_terms import ways_of_each
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.discovery_campaign import HeldArm
from validation.hidden.hidden_laws import LawArm
from validation.hidden.real_arm import arm_file

COUNT = 300  # rows


def test_noise_that_grows_with_the_rate_is_told_by_its_likelihood():
    file = arm_file()
    drag = Law(FORMS['x*abs(x)'], ('rate/joint_3',), 1.5, 'drag', 'dissipative')
    for colour, is_loud in (('speed', True), ('white', False)):
        record = observed(LawArm(1, colour=colour).record(0, ['joint_3'], 20.0), file.robot)
        balances = [balance_of(record, file.robot, file.effects)]
        rows = ArmRows.of(balances, [CATALOGUE['joint_viscous_friction']])
        quiet, loud = (JointScreen(ArmMotions(rows, balances), 2, (), s) for s in (0.0, 0.9))
        for laws in ([], [drag]):
            more = loud.likelihood((), laws) - quiet.likelihood((), laws)
            assert more * (1.0 if is_loud else -1.0) > 20.0


@pytest.fixture
def screen_of(monkeypatch):
    """A joint in white noise of 1, by its data, columns of causes and laws of one column each."""

    def of(data, columns, deviations, laws):
        monkeypatch.setattr(screens, 'leftover_level', lambda *_: np.eye(1, VARIANCES)[0])
        gap = np.r_[0.0, np.full(len(data) - 1, 0.1)]
        observed = np.zeros((len(data), 4))
        rows = JointRows(data, columns, observed, np.zeros(len(data), int), gap)
        every = [Law(FORMS['x'], (name,), 1.0, name, 'external') for name in laws]
        motions = SimpleNamespace(
            rows=SimpleNamespace(joints=[rows], deviations=lambda chosen: deviations),
            friction=np.zeros(1),
            loudness=lambda j, loud: np.ones(len(data)),
            laws=lambda j: every,
            torques=lambda some, j: np.column_stack(
                [np.zeros((len(data), 0)), *(laws[law.inputs[0]] for law in some)]
            ),
        )
        return JointScreen(motions, 0, (), 0.0)

    return of


@pytest.mark.parametrize('size', [1e2, 1e8])
def test_offsets_of_a_light_joint_hide_no_law(rng, screen_of, size):
    """A newton metre all along is 10^8 deviations of its noise, its law a few."""
    time = np.linspace(0.0, 1.0, COUNT)
    offsets = np.column_stack([time**k for k in range(3)])
    law = np.sin(25.0 * time)
    data = 3.0 * law + rng.standard_normal(COUNT) + size * offsets @ [1e-7, -2e-7, 1e-7]
    screen = screen_of(data, offsets, np.full(3, size), {'law': law})
    assert [law.inputs for law in screen.proposals((), [])] == [('law',)]
    assert screen.chance(screen.laws[0], (), []) < 1e-3


def test_a_law_that_is_mostly_a_constant_is_none_of_a_bias(rng, screen_of):
    """Another joint's spring far from its rest: what it has beside its mean is its own."""
    constant, swing = np.ones(COUNT), np.sin(25.0 * np.linspace(0.0, 1.0, COUNT))
    laws = {'spring': constant + 0.2 * swing}
    laws |= {f'other {k}': x for k, x in enumerate(rng.standard_normal((8, COUNT)))}
    data = 2.0 * swing + rng.standard_normal(COUNT)
    screen = screen_of(data, constant[:, None], np.ones(1), laws)
    assert screen.proposals((), [])[0].inputs == ('spring',)
    assert screen.chance(screen.laws[0], (), []) < 1e-3


@pytest.mark.parametrize(
    ('rivals', 'odds'),
    [
        ([], 0.0),
        ([('rate/a',), ('rate/a', 'rate/b', 'load/a')], 0.0),  # some of them, and more
        ([('angle/a', 'angle/b'), ('angle/a', 'angle/c')], np.exp(-3.1) + np.exp(-4.1)),
        ([('time',)], np.exp(-3.1)),
        ([None], np.exp(-3.1)),  # a cause
    ],
)
def test_what_else_does_as_well_is_a_doubt(rivals, odds):
    laws = [i and Law(FORMS['x*y'], i, 3.0, '', 'external') for i in rivals]
    law = Law(FORMS['x*y'], ('rate/a', 'rate/b'), 3.0, '', 'external')
    every = [SimpleNamespace(causes=(k,), log_odds=3.1 + k) for k in range(len(rivals))]
    found = SimpleNamespace(
        candidate=SimpleNamespace(of=law), inferred=SimpleNamespace(rivals=every)
    )
    search = SimpleNamespace(laws_of=lambda causes: tuple(filter(None, (laws[k] for k in causes))))
    assert doubt(found, search) == pytest.approx(odds)


def test_probabilities_of_laws_are_those_of_chance(rng):
    """Of 400 data without a law: no more have a small one than it says, as one law in ten is free.

    What is free costs nothing and gains nothing, so that the best score hardly ever is less.
    """
    laws = rng.standard_normal((60, COUNT)) / np.sqrt(COUNT)
    rows = COUNT * 5 // 4

    def largest(data: np.ndarray) -> np.ndarray:
        scores = 0.5 * (laws @ data) ** 2 - 0.5 * np.log(COUNT) - 2.0
        return np.maximum(np.max(scores, axis=0), -1.2)

    every = rng.standard_normal((400, COUNT))
    chances = [chance_of(float(largest(x[:, None])[0]), largest, x, rows) for x in every]
    for limit, most in ((0.1, 0.14), (0.01, 0.02), (1e-3, 0.0075)):
        assert np.mean(np.array(chances) <= limit) <= most
    assert np.mean(np.array(chances) <= 0.1) > 0.02  # nor is it much larger


def test_friction_that_drifts_is_no_law_of_it_where_noise_grows_with_the_rate():
    """What is white all along hides a drift; where the joint is slow it is seen all the same.

    Otherwise this machine without a law has one, friction that warms up.
    """
    machine = HeldArm(72023, '', 0.0, 'speed')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert [entry.form for entry in answer.leftover or ()] == [None] * 3


def test_directions_of_many_groups_are_those_of_each(rng):
    """Of one to three columns, one of which is twice another."""
    groups = [rng.standard_normal((40, k)) for k in (2, 1, 3, 2, 1)]
    groups[2][:, 2] = 2.0 * groups[2][:, 0]
    for columns, ways in zip(groups, ways_of_each(groups), strict=True):
        assert ways.shape == (40, np.linalg.matrix_rank(columns))
        np.testing.assert_allclose(ways @ ways.T, columns @ np.linalg.pinv(columns), atol=1e-12)


@pytest.mark.parametrize('way', [1.0, 4.0])
def test_a_sine_is_asked_where_the_motion_shows_a_period(way):
    """Along angles beyond a part of one it turns back, where a polynomial goes on."""
    extent = Extent({'a': 1.0}, {'a': 0.0}, {'a': way}, 10.0)
    sines = [law for law in joint_laws('a', {'a': 'rad'}, (), extent) if 'goes' in law.resembles]
    assert all(law.options['m'] * way >= 2.0 * np.pi for law in sines)
    assert any(law.options['m'] == 2.0 for law in sines) == (way > 2.0)
