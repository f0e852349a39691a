"""Which extra motion would tell what a record could not."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support.excitation import robot_file, six_joints, with_noise
from support.identification import measure, servicer, simulate

from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.trajectory.base_response import (
    BaseResponse,
    BaseStart,
    noise_free_record,
)
from spacerobot_ros.estimation.trajectory.motion_limits import Limits
from spacerobot_ros.identification import advice as advice_module
from spacerobot_ros.identification.advice import advise_on
from spacerobot_ros.identification.maximum_likelihood import MaximumLikelihood, prepare
from spacerobot_ros.identification.summary import Source, conclude
from spacerobot_ros.model.settings import Settings, parse_settings

TIME = np.arange(1001) / 100.0
SLIDE = [replace(p, kind='prismatic') if i == 2 else p for i, p in enumerate(six_joints())]
STRICT = {'valid_std': 1e-5}


def settings_of(joints, **sections) -> Settings:
    return parse_settings({'robot': {'joints': list(joints)}, **sections})


def likelihood_of(record, robot, settings, known=None):
    """Maximum likelihood of a record."""
    model = MomentumModel(robot, settings.identifier.structure, settings.identifier.nuisances)
    noise, _ = noise_levels(robot.sensors, record, is_checked=False)
    likelihood = MaximumLikelihood(model, settings.identifier, known)
    likelihood.solve(prepare(record, noise))
    return model, likelihood


def advised(record, robot, settings):
    _, likelihood = likelihood_of(record, robot, settings)
    return advise_on(record, conclude(likelihood, 'ml', Source(0, 0)), settings)


@lru_cache
def with_joint_locked(joint, valid_std=1e-5):
    """Advice on a run in which one joint stays where it is."""
    robot = servicer('zyx')
    settings = settings_of(robot.joints, identifier={'valid_std': valid_std})
    return advised(measure(simulate('zyx', 20.0, f'locked_{joint}'), 1), robot, settings)


def swung(file, moving, seed=0):
    """Ten seconds in which some joints swing by 0.4 rad, or m."""
    n = file.robot.n_joints
    amplitude = np.where(np.isin(np.arange(n), moving), 0.2, 0.0)
    rate = 2.0 * np.pi / 10.0 * (1.0 + 0.3 * np.arange(n))
    turn = TIME[:, None] * rate
    q = amplitude * (1.0 - np.cos(turn))
    qd, qdd = amplitude * rate * np.sin(turn), amplitude * rate**2 * np.cos(turn)
    start = BaseStart(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    motion = BaseResponse(file.robot).move(TIME, q[None], qd[None], qdd[None], start)
    return with_noise(noise_free_record(file.robot, motion, file.settings.simulator), seed)


@pytest.mark.parametrize('joint', [1, 2, 3])
def test_motions_are_named_with_what_they_make_of_the_deviation(joint):
    advice = with_joint_locked(joint)
    assert 1 <= len(advice) <= 5
    for one in advice:
        words = one.tells[0]
        before, after = map(float, re.findall(r'\+- ([\d.e-]+)', words))
        assert re.search(r'N m s in 40 s \([\d.e+]+ times better\)', words)
        # two digits each
        assert after == pytest.approx(one.aam_std, rel=0.06)
        assert before / after == pytest.approx(one.factor, rel=0.12)
        assert one.factor > 1.05


def test_a_joint_that_moved_nothing_of_the_wheels_is_not_enough():
    """Only the first of six joints moves: another one is asked for, and its motion tells."""
    file = robot_file(six_joints(), identifier=STRICT)
    advice = advised(swung(file, [0]), file.robot, file.settings)
    assert advice[0].motion.startswith('move j_link_')
    assert not advice[0].motion.startswith('move j_link_1 ')
    assert advice[0].factor > 2.0


@pytest.mark.parametrize('parts', [six_joints(), SLIDE], ids=['turning', 'a slide'])
def test_a_motion_tells_what_was_said(parts, monkeypatch):
    """The advised motion, played and identified on top of the record."""
    file = robot_file(parts, identifier=STRICT)
    played = {}
    play = advice_module._Range._play

    def remembered(self, probe):
        found = play(self, probe)
        if found is not None:
            played[found[1]] = found
        return found

    monkeypatch.setattr(advice_module._Range, '_play', remembered)
    record = swung(file, [0])
    model, first = likelihood_of(record, file.robot, file.settings)
    best = advise_on(record, conclude(first, 'ml', Source(0, 0)), file.settings)[0]
    probe, _, coarse = played[best.motion.removeprefix('bring the base to rest, then ')]
    times = np.arange(0.0, 40.005, 0.01)
    monkeypatch.setattr(advice_module, '_TIMES', times)
    joint = probe.joints[0]
    far, rest = 0.5 * (coarse.q[0, 40, joint] - coarse.q[0, 0, joint]), coarse.q[0, 0]
    reach = np.zeros(len(rest))
    reach[joint] = far  # half a period of 20 s is at the tenth second
    start = BaseStart(np.array([0.0, 0.0, 0.0, 1.0]), coarse.omega[0, 0])
    joints = advice_module._swing(probe, reach, rest)
    motion = BaseResponse(file.robot).move(times, *joints, start)
    more = with_noise(noise_free_record(file.robot, motion, file.settings.simulator), 3)
    known = first.known.of(slice(3, model.filter_bodies.stop))
    _, both = likelihood_of(more, file.robot, file.settings, known)
    # cheap information on the estimate instead of the truth, and another factor of the prior
    std = np.sqrt(np.diag(both.posterior().covariance))[model.aam]
    assert np.max(std) == pytest.approx(best.aam_std, rel=0.5)


def test_motions_keep_the_limits_of_joints_and_base():
    sensors = {'gyro_range': 0.02, 'attitude_rate_limit': 0.03}
    file = robot_file(six_joints(), identifier=STRICT)
    n = file.robot.n_joints
    robot = replace(
        file.robot,
        sensors=replace(file.robot.sensors, **sensors),
        position_limits=np.tile([-0.3, 0.5], (n, 1)),
        velocity_limits=np.full(n, 0.1),
    )
    record = swung(file, [0])
    model, likelihood = likelihood_of(record, robot, file.settings)
    posterior = likelihood.posterior()
    range_ = advice_module._Range(record, model, posterior, file.settings)
    limits = Limits(model.robot_at(posterior.mean), file.settings.excitation)
    probes = [advice_module._Probe((j,)) for j in range(n)]
    probes += [advice_module._Probe(tuple(range(n))), advice_module._Probe(spins=True)]
    probes += [advice_module._Probe(turn=axis) for axis in range(3)]
    played = [found for probe in probes if (found := range_._play(probe)) is not None]
    assert len(played) > n
    for _, words, motion in played:
        assert np.max(limits.fractions(motion)) <= 1.0, words
        assert np.max(np.abs(motion.omega)) <= 0.02
        assert np.max(motion.q) <= 0.5


def test_nothing_is_asked_for_where_the_wheels_are_known_well():
    assert with_joint_locked(3, valid_std=0.05) == ()


def test_joints_without_room_are_not_asked_for():
    file = robot_file(six_joints(), identifier=STRICT)
    limits = np.tile([-3.0, 3.0], (6, 1))
    limits[5] = 0.2, 0.21
    robot = replace(file.robot, position_limits=limits)
    for one in advised(swung(file, [0]), robot, file.settings):
        assert 'j_link_6' not in one.motion
