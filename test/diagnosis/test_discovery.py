"""What a leftover depends on: hidden laws, no law, a clock, another recording that says no."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.answer.output import to_dict
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.discovery.other_recording import judged_on
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects
from spacerobot_ros.recording.record import to_stamps
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.report.leftover_tables import leftover_items, leftover_lines
from validation.hidden.discovery_campaign import HeldArm
from validation.hidden.hidden_laws import LAWS
from validation.hidden.real_arm import COULOMB, POSE, RATE, RealArm, arm_file

FEW = [CATALOGUE[f'joint_{name}_friction'] for name in ('coulomb', 'viscous')]
MOVING, DURATION = ('joint_2', 'joint_3'), 20.0
SIZE = 0.4  # of the Coulomb torque: three times what else is left
Law = Callable[..., np.ndarray]


@dataclass(frozen=True, eq=False)
class LawArm(RealArm):
    """An arm with a torque of joint_3 that nobody has named: (q, q', time) -> (N,)."""

    law: Law | None = None

    def _motor(self, rng, q, qd, qdd):
        torque = super()._motor(rng, q, qd, qdd)
        if self.law is not None:
            hidden = self.law(q, qd, np.arange(len(q)) / RATE)
            torque[:, 2] += SIZE * COULOMB[2] * hidden / np.sqrt(np.mean(hidden**2))
        return torque


def asked(law, run=0, seed=3):
    file = arm_file()
    record = LawArm(seed, law=law).record(run, MOVING, DURATION)
    return diagnose(record, file.robot, file.effects, FEW), record


def of_joint(answer, joint='joint_3'):
    (entry,) = [e for e in answer.leftover if e.channel == f'joint_torque/{joint}']
    return entry


def drag(q, qd, t):
    return qd[:, 2] * np.abs(qd[:, 2])


@pytest.fixture(scope='module')
def dragged():
    return asked(drag)


def test_a_hidden_law_is_said_with_its_variables_and_size(dragged):
    answer, _ = dragged
    entry = of_joint(answer)
    assert answer.verdict == 'partly_explained'
    assert entry.depends_on == ('rate/joint_3',)
    assert entry.form == 'x*abs(x)'
    q = LawArm(3).record(0, MOVING, DURATION).joints.position[:, 2]
    rate = np.gradient(q, 1.0 / RATE)
    true = SIZE * COULOMB[2] / np.sqrt(np.mean((rate * rate) ** 2))
    (c,) = entry.coefficients
    assert c.unit == 'N m s^2/rad^2'
    assert abs(c.value + true) < 4.0 * c.std + 0.1 * true  # beside the drift of friction
    assert entry.p_value < 1e-5
    assert entry.held_out_gain > 0.1
    assert of_joint(answer, 'joint_2').depends_on == ('nothing measured',)


def test_the_law_is_an_effect_that_loads(dragged):
    answer, _ = dragged
    applied = of_joint(answer).applied
    assert applied.guard.kind == 'dissipative'
    given = {'effect': 'learned_torque', 'where': 'joint_3', **applied.entry()}
    again = bind_effects({'law': given}, arm_file().robot)[0]
    assert again.values == applied.values
    low, high = applied.guard.range['rate']
    largest = abs(applied['c1']) * max(low**2, high**2)
    assert applied.guard.limit == pytest.approx(1.49 * largest, rel=1e-6)


def test_results_say_it(dragged):
    answer, _ = dragged
    (said,) = [e for e in to_dict(answer)['leftover'] if e['form']]
    assert said['channel'] == 'joint_torque/joint_3'
    assert said['learned'] == 'learned_torque_joint_3'
    assert said['other_recording'] is None
    assert any('x*abs(x) of rate/joint_3' in line for line in leftover_lines(answer))
    assert any(
        'torque: c1 * (rate*abs(rate))' in item
        for item in leftover_items(answer)
        if isinstance(item, str)
    )


def test_another_recording_confirms_a_law_or_takes_it_out(dragged):
    answer, _ = dragged
    file = arm_file()
    same, none = (LawArm(3, law=law).record(1, MOVING, DURATION) for law in (drag, None))
    kept, gone = (
        of_joint(replace(answer, leftover=judged_on(r, file.robot, file.effects, answer.leftover)))
        for r in (same, none)
    )
    assert kept.other_recording > 0.5
    assert kept.applied is not None
    assert gone.other_recording < 0.0
    assert gone.applied is None
    assert gone.form == 'x*abs(x)'  # it is still said


def test_a_spring_that_stiffens_is_no_spring_with_a_ripple():
    """Both together come close and are the catalogue's; one law explains more in their place."""
    file = arm_file()
    centre = float(POSE[2])
    record = LawArm(3, law=lambda q, qd, t: (q[:, 2] - centre) ** 3).record(0, MOVING, DURATION)
    bent = [CATALOGUE[f'joint_{name}'] for name in ('stiffness', 'torque_ripple')]
    answer = diagnose(record, file.robot, file.effects, [*FEW, *bent])
    assert not answer.causes
    law = of_joint(answer).applied
    assert law.formula.quantities == ('position',)
    u = np.linspace(*law.guard.range['position'], 200) - centre
    torque = law.formula({'position': u + centre}, law.values)
    assert np.corrcoef(torque, -(u**3))[0, 1] > 0.97  # beside a third of it that is anything


def test_a_ripple_of_which_a_motion_shows_a_part_gives_way_to_a_spring_that_stiffens():
    """A ripple and a spring are found there, and leave a thousandth less of the rows as they are.

    At once its noise nothing is found beside the law, and its values are not told well enough.
    """
    machine = HeldArm(506, 'cubic spring', 3.0, 'slow')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert not answer.causes
    entry = of_joint(answer, machine.where)
    assert list(entry.depends_on) == machine.variables
    assert machine.transferred([*answer.calibration, entry.applied]) > 0.95


def test_a_spring_near_the_stops_is_no_spring_all_along():
    """Of a spring that stiffens the linear one beside noise that grows with the rate has most."""
    machine = HeldArm(2806, 'cubic spring', 1.0, 'speed')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert of_joint(answer, machine.where).depends_on == tuple(machine.variables)
    assert 'joint_stiffness' not in [c.applied.id for c in answer.causes]


@pytest.mark.parametrize(
    ('kind', 'seed', 'law'),
    [
        ('joint_stiffness', 8305, lambda q, v, T, t, j, k: q[:, j] - POSE[j]),
        ('joint_torque_ripple', 603, lambda q, v, T, t, j, k: np.sin(2.0 * q[:, j] + j + 0.5)),
    ],
)
def test_a_cause_that_is_one_keeps_its_name(kind, seed, law, monkeypatch):
    """The same as a law, with the prior of a law's size, is 6 to 10 nats ahead of its name."""
    monkeypatch.setitem(LAWS, kind, (law, 'q'))
    machine = HeldArm(seed, kind, 3.0, 'white')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert of_joint(answer, machine.where).form is None
    assert [c.applied.id for c in answer.causes] == [kind]


def test_friction_of_the_other_joint_is_told_from_its_own():
    answer, _ = asked(lambda q, qd, t: np.sign(qd[:, 1]))
    entry = of_joint(answer)
    assert entry.depends_on == ('rate/joint_2',)
    assert entry.kind == 'coupled'


def test_friction_of_a_sum_of_rates_at_one_joint_is_no_friction_of_both():
    """Friction of both joints' motor stood for it and was not clear, as the other shows none."""
    machine = HeldArm(905, 'sum of rates', 1.0, 'speed')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert not answer.causes
    entry = of_joint(answer, machine.where)
    assert set(entry.depends_on) == set(machine.variables)
    assert not entry.applied.guard.react
    assert machine.transferred([*answer.calibration, entry.applied]) > 0.9


def test_another_joint_s_friction_is_needed_though_its_own_angle_explains_half_of_it():
    machine = HeldArm(1104, 'coupled Coulomb', 1.0, 'white')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert list(of_joint(answer, machine.where).depends_on) == machine.variables


def test_friction_that_goes_with_a_temperature_is_said_so():
    """The temperature is measured beside the motion, by a slow clock of its own."""

    def temperature(t):
        return 30.0 + 15.0 * np.sin(0.4 * t) + 8.0 * np.sin(1.1 * t + 1.0)

    file = arm_file()
    law = LawArm(3, law=lambda q, qd, t: (1.0 - 0.02 * temperature(t)) * qd[:, 2])
    record = law.record(0, MOVING, DURATION)
    slow = np.linspace(0.0, DURATION, 80)
    series = InputSeries(('motor',), to_stamps(slow), temperature(slow)[:, None], ('degC',))
    record = replace(record, inputs={'extra/motor': series})
    entry = of_joint(diagnose(record, file.robot, file.effects, FEW))
    assert set(entry.depends_on) == {'rate/joint_3', 'extra/motor'}
    assert entry.form == 'x, x*y'
    assert [c.unit for c in entry.coefficients] == ['N m s/rad', 'N m s/rad motor']


def test_what_follows_a_clock_is_no_law():
    answer, _ = asked(lambda q, qd, t: np.sin(2.0 * np.pi * (0.31 * t + 0.005 * t**2)))
    entry = of_joint(answer)
    assert entry.depends_on == ('time',)
    assert entry.form is None
    assert entry.applied is None


def test_an_arm_as_it_should_be_has_no_law():
    answer, _ = asked(None)
    assert [e.depends_on for e in answer.leftover] == [('nothing measured',)] * 2
    assert all(e.form is None for e in answer.leftover)


def by_angle(q, qd, t):
    return np.sin(3.0 * q[:, 2]) * np.sign(qd[:, 2])


@pytest.mark.parametrize('law', [None, by_angle])
def test_a_joint_of_one_speed_is_told(law, monkeypatch):
    def back_and_forth(rng, time, is_moving):
        turns = np.floor(time / 4.0) % 2
        way = np.where(turns == 0, time % 4.0, 4.0 - time % 4.0)
        q = 0.25 * way[:, None] * is_moving
        qd = np.where(turns == 0, 0.25, -0.25)[:, None] * is_moving
        return q, qd, np.zeros_like(q)

    monkeypatch.setattr('validation.hidden.real_arm.motion_of', back_and_forth)
    answer, _ = asked(law)
    entry = of_joint(answer)
    assert (entry.form is None) == (law is None)
    assert entry.one_speed
    assert any('joint_3' in x and 'moves at one speed only' in x for x in leftover_lines(answer))
