"""`spacerobot excite --separate` from the outside, and its measure of what is told apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps

from spacerobot_ros.cli.main import main
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.excitation.motions import Motions
from spacerobot_ros.excitation.separation import CONFOUNDED, Contrast, Place, trial

CONFIG = Path(__file__).parents[2] / 'config'
VISCOUS = 'joint_viscous_friction@joint_2'
COULOMB = 'joint_coulomb_friction@joint_2'


@pytest.fixture
def robot(tmp_path):
    """The servicer, searched briefly, its sensors slow."""
    content = yaml.safe_load((CONFIG / 'servicer.yaml').read_text())
    values = content['/**']['ros__parameters']
    values['excitation'] = {'starts': 1, 'iterations': 1}
    values['simulator'].update(period=0.05, joint_rate=20.0, imu_rate=20.0)
    path = tmp_path / 'servicer.yaml'
    path.write_text(yaml.safe_dump(content))
    return path


def test_the_motion_found_is_no_worse_than_the_file_s_own(robot, tmp_path, capsys):
    out = tmp_path / 'separate.yaml'
    arguments = ['excite', '--robot', str(robot), '-o', str(out), '--duration', '20']
    assert main([*arguments, '--separate', VISCOUS, COULOMB, '--json']) == 0
    found = keeps('excite_separate', capsys.readouterr().out)
    assert found['separate'] == [VISCOUS, COULOMB]
    best, own = found['best']['sides'], found['robot_file']['sides']
    assert np.prod([s['told'] for s in best]) >= np.prod([s['told'] for s in own])
    assert all(0.0 < side['sine'] <= 1.0 for side in best)
    file = load_robot_file(out)
    assert file.settings.reference.kind == 'fourier'
    assert file.settings.reference.duration == found['best']['duration']
    assert main([*arguments, '--separate', VISCOUS, COULOMB]) == 2  # never over what is there


def test_an_effect_is_not_told_from_itself(robot):
    file = load_robot_file(robot)
    motions = Motions(file.believed, file.settings, 20.0)
    x = motions.family.amplitudes(file.settings.reference)
    names = ('joint_viscous_friction', 'joint_coulomb_friction')
    places = tuple(Place(CATALOGUE[name], 'joint_2') for name in names)
    flight = trial(file, motions, x, 'own', places)
    same = trial(file, motions, x, 'own', (places[0], places[0]))
    assert flight.first.sine > 0.1
    # but for the prior, of one noise standard deviation, an effect imitates itself
    assert same.first.apart == pytest.approx(1.0, abs=0.01)
    gentle = trial(file, motions, 0.3 * x, 'own', places)
    # a viscous torque is in proportion to the rates
    assert gentle.first.visible == pytest.approx(0.3 * flight.first.visible, rel=0.2)


def test_smallest_told_is_where_the_gap_in_evidence_is_reached():
    contrast = Contrast(visible=50.0, apart=20.0)
    assert contrast.sine == 0.4
    assert 0.5 * (contrast.smallest * contrast.apart) ** 2 == pytest.approx(CONFOUNDED, rel=1e-12)
    assert Contrast(visible=0.0, apart=0.0).smallest == np.inf


@pytest.mark.parametrize(
    ('effects', 'message'),
    [
        (('joint_viscus_friction@joint_2', COULOMB), 'did you mean joint_viscous_friction'),
        (('joint_viscous_friction', COULOMB), 'joint_viscous_friction acts at one of joint_1,'),
        ((COULOMB, COULOMB), 'is given twice'),
    ],
)
def test_bad_effects_are_one_line(robot, tmp_path, capsys, effects, message):
    out = tmp_path / 'out.yaml'
    assert main(['excite', '--robot', str(robot), '-o', str(out), '--separate', *effects]) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert message in error
    assert not out.exists()


def test_options_of_the_other_design_are_refused(robot, tmp_path, capsys):
    arguments = ['excite', '--robot', str(robot), '-o', str(tmp_path / 'o'), '--separate']
    assert main([*arguments, VISCOUS, COULOMB, '--criterion', 'condition']) == 2
    assert 'has no meaning with --separate' in capsys.readouterr().err
