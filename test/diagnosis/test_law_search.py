"""What a search for laws takes for noise, and what it leaves to causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.discovery.arm_channels import ArmMotions, JointChannel
from spacerobot_ros.diagnosis.discovery.channel_laws import settled
from spacerobot_ros.diagnosis.discovery.discovery_limits import UNSETTLED
from spacerobot_ros.diagnosis.discovery.law_search import LawSearch, Winner, chance_of
from spacerobot_ros.diagnosis.discovery.possible_laws import PLAIN, SINE, Extent, Law
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.laws.grammar import FORMS
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.inference.spectral_terms import (
    SpectralTerms,
    cosines,
    ways_of,
    ways_of_each,
)
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.discovery_campaign import HeldArm
from validation.hidden.hidden_laws import LawArm
from validation.hidden.real_arm import arm_file

COUNT = 300  # terms


@pytest.mark.parametrize(('colour', 'loud'), [('speed', 0.9), ('white', 0.0)])
def test_noise_that_grows_with_the_rate_is_told_by_its_likelihood(colour, loud):
    file = arm_file()
    record = observed(LawArm(1, colour=colour).record(0, ['joint_3'], 20.0), file.robot)
    rows = ArmRows.of(
        [balance_of(record, file.robot, file.effects)], [CATALOGUE['joint_viscous_friction']]
    )
    channel = JointChannel(ArmMotions(rows, rows.balances), 2, ())
    assert channel.likeliest([]).loud == loud
    drag = Law(FORMS['x*abs(x)'], ('rate/joint_3',), 1.5, 'drag', 'dissipative')
    assert channel.likeliest([drag]).loud == loud


@dataclass
class Terms:
    """A channel of given terms."""

    terms: SpectralTerms
    by_input: dict[str, np.ndarray]
    place: str = 'joint'

    def columns(self, laws: Sequence[Law]) -> list[np.ndarray]:
        return [self.by_input[law.inputs[0]][:, None] for law in laws]

    @property
    def laws(self) -> list[Law]:
        every = self.by_input
        return [Law(FORMS['x'], (name,), 1.0, name, 'dissipative') for name in every]

    times = np.arange(COUNT * 5 // 4)  # rows, of which the band has four fifths
    part = times * 5 // len(times)


@pytest.mark.parametrize('bend', [0.15, 0.5])
def test_what_a_free_cause_nearly_is_is_no_law_of_others(bend):
    """The hidden column is the cause's and a part of its own, which another law shares.

    Of the one that is 2 % its own nothing is said; of the one that is a fifth so the law.
    """
    rng = np.random.default_rng(2)
    cause, own, another, noise = rng.standard_normal((4, COUNT))
    true = cause + bend * own
    data = true / bend + noise
    free = SpectralTerms(data, 20.0 * cause[:, None], np.ones(1, dtype=bool))
    every = {'true': true, 'false': own + 0.7 * another}
    every |= {f'other {k}': column for k, column in enumerate(rng.standard_normal((8, COUNT)))}
    won = [step.law.inputs for step in LawSearch(Terms(free, every)).run()]
    assert won == ([('true',)] if bend > 0.2 else [])


@pytest.mark.parametrize(
    ('rivals', 'doubt'),
    [
        ({}, 0.0),
        ({('rate/a',): 1.0, ('rate/a', 'rate/b', 'load/a'): 1.0}, 0.0),  # some of them, and more
        ({('angle/a', 'angle/b'): 3.1, ('angle/a', 'angle/c'): 3.8}, np.exp(-3.1) + np.exp(-3.8)),
        ({('time',): 0.5}, np.exp(-0.5)),
    ],
)
def test_laws_of_other_variables_that_do_as_well_are_a_doubt(rivals, doubt):
    laws = tuple((Law(FORMS['x*y'], i, 3.0, '', 'external'), gap) for i, gap in rivals.items())
    law = Law(FORMS['x*y'], ('rate/a', 'rate/b'), 3.0, '', 'external')
    assert Winner(law, np.zeros((1, 1)), 9.0, 1e-9, laws).doubt == pytest.approx(doubt)


@dataclass
class Forms(Terms):
    """A channel of terms by form and input."""

    def columns(self, laws):
        return [self.by_input[law.form.name, law.inputs[0]][:, None] for law in laws]

    @property
    def laws(self):
        return [Law(FORMS[f], (name,), 1.0, name, 'coupled') for f, name in self.by_input]


@pytest.mark.parametrize('alike', [0.8, 0.999])
def test_laws_of_one_joint_are_asked_of_others_together(alike):
    """Two laws of joint b stand for the same two of a, which moves much as b does.

    Where it moves as good as alike nobody knows whose they are.
    """
    rng = np.random.default_rng(4)
    first, second, noise, *more = rng.standard_normal((5, COUNT))
    every = {('x', 'angle/a'): first, ('x**3', 'angle/a'): second}
    for (form, _), column, own in zip(list(every), (first, second), more, strict=True):
        every[form, 'angle/b'] = alike * column + np.sqrt(1.0 - alike**2) * own
    terms = SpectralTerms(
        2.0 * first + second + noise, np.zeros((COUNT, 0)), np.zeros(0, dtype=bool)
    )
    search = LawSearch(Forms(terms, every))
    wrong = [
        Winner(law, c, 9.0, 1e-9)
        for law, c in zip(search.laws, search.channel.columns(search.laws), strict=True)
    ]
    steps = settled(search, wrong[2:])
    assert [step.law.form.name for step in steps] == ['x', 'x**3']
    if alike < 0.9:
        assert [step.law.inputs for step in steps] == [('angle/a',)] * 2
        assert [step.doubt for step in steps] == [0.0, 0.0]
    else:
        assert all(step.doubt > UNSETTLED for step in steps)


@pytest.mark.parametrize('size', [1e2, 1e8])
def test_offsets_of_a_light_joint_hide_no_law(rng, size):
    """A newton metre all along is 10^8 deviations of its noise, its law a few."""
    time = np.linspace(0.0, 1.0, COUNT)
    offsets = size * np.column_stack([time**k for k in range(3)])
    law = np.sin(25.0 * time)[:, None]
    data = 3.0 * law[:, 0] + rng.standard_normal(COUNT) + offsets @ [1e-7, -2e-7, 1e-7]
    terms = SpectralTerms.of(data, offsets, np.ones(3, dtype=bool), lambda values: values)
    level = terms.level(cosines(law))
    nothing = terms.level(np.zeros((len(terms.data), 0)))
    assert level.likelihood - nothing.likelihood > 10.0  # 23, beside noise with a line there
    assert level.coefficients[0] == pytest.approx(3.0, abs=4.0 * np.sqrt(level.covariance[0, 0]))


class Steady(Terms):
    """Of as many rows as it has data, every law with a constant beside it."""

    times = np.arange(COUNT)
    part = times * 5 // COUNT

    def columns(self, laws):
        constant = cosines(np.ones(COUNT))
        return [np.column_stack([constant, self.by_input[law.inputs[0]]]) for law in laws]


def test_a_law_that_is_mostly_a_constant_is_none_of_a_bias(rng):
    """Another joint's spring far from its rest: what it has beside its mean is its own."""
    constant, swing = np.ones(COUNT), np.sin(25.0 * np.linspace(0.0, 1.0, COUNT))
    data = swing + 0.5 * rng.standard_normal(COUNT)
    terms = SpectralTerms.of(data, constant[:, None], np.ones(1, dtype=bool), lambda rows: rows)
    every = {'spring': cosines(constant + 0.2 * swing)}
    every |= {f'other {k}': x for k, x in enumerate(rng.standard_normal((8, len(terms.data))))}
    search = LawSearch(Steady(terms, every))
    assert [step.law.inputs for step in search.run()] == [('spring',)]


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
        alone, _ = ways_of(columns)
        assert ways.shape == (40, np.linalg.matrix_rank(columns))
        np.testing.assert_allclose(ways @ ways.T, alone @ alone.T, rtol=0, atol=1e-12)


@pytest.mark.parametrize(('m', 'way', 'gap', 'is_plain'), [
    (2.0, 1.0, 0.5, True), (2.0, 4.0, 0.5, False), (2.0, 1.0, 6.5, False),
])  # fmt: skip
def test_a_part_of_a_sine_gives_way_to_a_polynomial_that_does_as_well(m, way, gap, is_plain):
    """Whole periods were seen, or a gap that tells them apart: the sine stays."""
    forms = [(SINE, {'m': m}), ('min(x, lower) - lower, max(x, upper) - upper', {}), (PLAIN, {})]
    laws = [Law(FORMS[n], ('angle/a',), 2.5, n, 'potential', o) for n, o in forms]
    extent = Extent({'a': 1.0}, {'a': 0.0}, {'a': way}, 10.0)
    search = SimpleNamespace(laws=laws, channel=SimpleNamespace(extent=extent))
    refitted = [(20.0, 0, None), (20.0 - 0.2, 1, None), (20.0 - gap, 2, None)]
    chosen = LawSearch._plainer(search, refitted)
    assert chosen == ((20.0 - gap, 2) if is_plain else (20.0, 0))
