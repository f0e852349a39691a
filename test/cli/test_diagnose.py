"""`spacerobot diagnose` from the outside: verdicts, files, printed text, exit statuses."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps
from support.diagnosis import hand_made

from spacerobot_ros.cli import main
from spacerobot_ros.cli.options import check_folder
from spacerobot_ros.cli.terminal import print_sections
from spacerobot_ros.diagnosis import findings
from spacerobot_ros.diagnosis.answer.cause import Rival
from spacerobot_ros.diagnosis.answer.closed_loop_gain import ClosedLoopGain, RmsErrors
from spacerobot_ros.diagnosis.answer.next_motion import with_motions
from spacerobot_ros.diagnosis.findings import Findings
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.formats import number, probability, value_with
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record
from spacerobot_ros.report.diagnosis_page import diagnosis_page
from spacerobot_ros.report.diagnosis_tables import remaining, summary
from spacerobot_ros.report.html import render

CONFIG = Path(__file__).resolve().parents[2] / 'config'
ROBOT = str(CONFIG / 'servicer.yaml')
FRICTION = 1.0  # N m s/rad
FEW = ('joint_viscous_friction', 'joint_coulomb_friction', 'encoder_offset', 'gyro_bias')


def write_robot(path, **sections):
    """The servicer with other sections."""
    content = yaml.safe_load((CONFIG / 'servicer.yaml').read_text())
    values = content['/**']['ros__parameters']
    values.update(truth={}, **sections)
    values['simulator'].update(period=0.02, joint_rate=50.0, imu_rate=50.0)  # half the work
    path.write_text(yaml.safe_dump(content))
    return str(path)


@pytest.fixture(scope='module')
def model(tmp_path_factory):
    """The servicer as its file believes it to be, the truth being no different."""
    return write_robot(tmp_path_factory.mktemp('robots') / 'model.yaml')


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A short flight of the servicer with friction that its model lacks."""
    folder = tmp_path_factory.mktemp('flight')
    friction = {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': FRICTION}
    hidden = write_robot(folder / 'hidden.yaml', effects={'hidden': friction})
    path = folder / 'bag'
    arguments = ['simulate', '--robot', hidden, '-o', str(path), '--duration', '10']
    assert main.main(arguments) == 0
    return str(path)


@pytest.fixture
def few_effects(monkeypatch):
    """A small catalogue: the whole one is tried in test/diagnosis."""
    import spacerobot_ros.diagnosis.diagnose as engine

    monkeypatch.setattr(engine, 'kinds_beside', lambda believed: [CATALOGUE[n] for n in FEW])


def run(capsys, *arguments):
    status = main.main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def fails(capsys, *arguments):
    """The one line on stderr of a run that must end with status 2 and print nothing."""
    status, out, err = run(capsys, 'diagnose', *arguments)
    assert status == 2
    assert out == ''
    assert err.count('\n') == 1
    assert err.startswith('spacerobot diagnose: ')
    return err


# ---------------------------------------------------------------- the whole way


@pytest.mark.usefixtures('few_effects', 'no_progress')
def test_hidden_friction_is_found_and_the_extended_model_is_consistent(
    capsys, bag, model, tmp_path
):
    out = tmp_path / 'found'
    status, text, _ = run(capsys, 'diagnose', bag, '--robot', model, '--out', out)
    assert status == 1
    assert text.startswith('verdict: explained\n')
    assert 'joint_viscous_friction at joint_2' in text
    found = keeps('diagnose', (out / 'diagnosis.json').read_text())
    (cause,) = found['causes']
    assert (cause['effect'], cause['where']) == ('joint_viscous_friction', 'joint_2')
    coefficient = cause['parameters']['coefficient']
    assert abs(coefficient['value'] - FRICTION) < 4.0 * coefficient['std']
    assert found['closed_loop']['ratio'] < 0.8  # the rest is sensor noise
    assert (out / 'report.html').read_text().startswith('<!doctype html>')

    again = tmp_path / 'again'
    extended = out / 'extended_model.yaml'
    arguments = ('diagnose', bag, '--robot', extended, '--out', again, '--json')
    status, text, err = run(capsys, *arguments)
    assert status == 0
    assert err == ''
    assert text == (again / 'diagnosis.json').read_text()
    assert keeps('diagnose', text)['verdict'] == 'consistent'


# ---------------------------------------------------------------- what is printed


def answer(tmp_path, verdict='explained'):
    rival = Rival(effect='joint_coulomb_friction', where='joint_2', bic_gap=1.5, motion='')
    stamps = np.arange(0, 10_000_000_000, 10_000_000)
    zeros = np.zeros((len(stamps), 3))
    return Findings(
        diagnosis=with_motions(hand_made(verdict, (rival,)), 'robot.yaml'),
        file=load_robot_file(ROBOT),
        records=(
            Record(
                JointSeries(('joint_1', 'joint_2', 'joint_3'), stamps, zeros),
                RateSeries(stamps, zeros),
            ),
        ),
        added=(hand_made().causes[0].applied,),
        calibration=(),
        closed_loop=ClosedLoopGain(
            task='a task', duration=5.0, joints={'joint_2': RmsErrors('rad', 1e-2, 1e-3)}
        ),
        why_open='',
        command='spacerobot diagnose bag --robot robot.yaml --out out',
    )


def test_what_is_applied_without_a_name_is_said_and_no_worth_of_it(tmp_path, monkeypatch):
    """A model extended by what has no name tracked itself perfectly, whatever was left."""
    said = replace(hand_made('unexplained'), causes=(), series=())
    ripple = CATALOGUE['joint_torque_ripple'](
        name='ripple',
        where='joint_2',
        values={'amplitude': 0.372, 'harmonic': 1.0, 'phase': 0.5},
    )
    body = CATALOGUE['inertial_parameters'](name='body', where='link_2', values={'mass': 0.1})
    said = replace(said, calibration=(ripple, body))
    monkeypatch.setattr(findings, 'diagnose', lambda *args, **options: said)
    recording = tmp_path / 'short.npz'
    save_npz(answer(tmp_path).records[0], recording)
    found = findings.findings(findings.Question(data=(str(recording),), robot=ROBOT), 'command')
    assert found.closed_loop is None
    assert 'named' in found.why_open
    lines = [
        'joint_torque_ripple at joint_2: amplitude 0.372 N m, harmonic 1, phase 0.5 rad',
        'bodies, within the tolerance of any file: link_2',
    ]
    (section,) = (s for s in summary(found) if s.title.endswith('without a name:'))
    assert section.items == lines
    (causes,) = (s for s in diagnosis_page(found).sections if s.title == 'Causes')
    assert f'In the extended model without a name: {lines[0]}.' in causes.items


@pytest.mark.parametrize(
    ('method', 'told', 'not_told'),
    [
        ('prediction', 'one step ahead', 'balance'),
        ('balance', 'adds its own torques to the balance', 'one step ahead'),
        ('pose', 'predicted window by window', 'torque'),
        ('spin', 'spin that the magnetometer sees', 'torque'),
    ],
)
def test_the_page_tells_of_the_method_that_was_used(tmp_path, method, told, not_told):
    found = answer(tmp_path)
    tested = {'fit_p': None, 'null_p': None} if method == 'balance' else {}
    used = replace(found.diagnosis, method=method, residuals=(), series=(), **tested)
    page = diagnosis_page(replace(found, diagnosis=used))
    (how,) = (s.items for s in page.sections if s.title == 'How it was done')
    assert told in how[1]
    said = [item for s in page.sections for item in s.items if isinstance(item, str)]
    assert not [text for text in said if not_told in text]
    (left,) = (s.items for s in page.sections if s.title == 'What remains')
    assert ('ot tested' in left[0]) == (method == 'balance')


GOLDEN = """\
verdict: explained
The data differ from the model by friction; nothing else is left.
causes
cause where parameter value +- std unit matters from
viscous friction in a joint joint_2 coefficient 3.000 0.05 N m s/rad THRESHOLD
evidence
cause log L gain BIC gain p held out placebo constant p
joint_viscous_friction at joint_2 812 1610 < 1e-99 97.0 % 2.0 % 0.5
rivals:
joint_viscous_friction at joint_2 can not be told from joint_coulomb_friction at joint_2 with \
this motion (BIC gap 1.5); to separate them: spacerobot excite --robot robot.yaml --separate \
joint_viscous_friction@joint_2 joint_coulomb_friction@joint_2 -o separate.yaml
found, but too small to matter:
target_wheel_drag at link_3: time_constant never +- - s
residuals before and after (white p: probability of as much structure in white noise)
channel unit rms before rms after noise floor after/floor white p
joint_torque/joint_2 N m 0.687 0.0687 0.1 0.69 not tested
joint_rate/joint_2 rad/s 0.0691 0.00691 0.01 0.69 0.4
held-out prediction error, in standard deviations of the noise: 7 before, 1.01 after (6.8 with \
the best placebo)
closed loop in simulation, a task, 5 s: rms joint error 0.01 rad with the old model, 0.001 rad \
with the extended one
what to fly next:
To tell joint_viscous_friction@joint_2 from joint_coulomb_friction@joint_2, fly the motion that \
this designs: spacerobot excite --robot robot.yaml --separate joint_viscous_friction@joint_2 \
joint_coulomb_friction@joint_2 -o separate.yaml
note: joints: 1 gap
"""


def test_the_printed_summary(capsys, tmp_path):
    print_sections(summary(answer(tmp_path)))
    lines = (' '.join(line.split()) for line in capsys.readouterr().out.splitlines())
    text = ''.join(f'{line}\n' for line in lines if line.strip(' ─'))
    threshold = CATALOGUE['joint_viscous_friction'].parameters[0].relevant
    assert text == GOLDEN.replace('THRESHOLD', f'{threshold:g}')


@pytest.mark.parametrize('verdict', ['consistent', 'partly_explained'])
def test_the_report_has_everything_and_needs_no_network(tmp_path, verdict):
    page = render(diagnosis_page(answer(tmp_path, verdict)))
    for title in (
        'Verdict',
        'Causes',
        'Measured against simulated',
        'Prediction errors, channel by channel',
        'In closed loop',
        'What remains',
        'What to fly next',
        'How it was done',
    ):
        assert f'<h2>{title}</h2>' in page
    assert verdict.replace('_', ' ') in page
    assert 'spacerobot diagnose bag' in page
    assert 'src=' not in page


def test_what_remains_allows_for_the_scatter_of_few_samples():
    assert remaining(hand_made()) == []
    assert number(float('inf')) == 'never'
    assert number(float('nan')) == '-'
    assert probability(0.0) == '< 1e-99'


@pytest.mark.parametrize(
    ('value', 'std', 'text'),
    [
        (42.0, 0.0024, '42.0000'),
        (3.0, 0.05, '3.000'),
        (1.234e-5, 3e-7, '1.234e-05'),
        (-0.02, 5.0, '-0.020'),
        (1234.0, 10.0, '1234'),
        (float('inf'), float('nan'), 'never'),
    ],
)
def test_values_are_printed_as_far_as_they_are_known(value, std, text):
    assert value_with(value, std) == text


# ---------------------------------------------------------------- what is refused


def test_a_diagnosis_is_not_replaced_unless_told(capsys, bag, model, tmp_path):
    (tmp_path / 'diagnosis.json').write_text('{}')
    err = fails(capsys, bag, '--robot', model, '--out', tmp_path)
    assert 'holds a diagnosis already (--force replaces it)' in err
    assert check_folder(str(tmp_path), ('diagnosis.json', 'a diagnosis'), force=True) == tmp_path


def test_a_folder_that_can_not_be_written_is_refused_first(capsys, tmp_path):
    (tmp_path / 'file').write_text('')
    err = fails(capsys, 'no_data', '--robot', 'no_robot', '--out', tmp_path / 'file' / 'deeper')
    assert 'is a file, not a folder' in err


def test_unusable_data_are_one_line(capsys, bag, model, tmp_path):
    out = tmp_path / 'out'
    usual = ('--robot', model, '--out', out)
    assert 'no such file' in fails(capsys, tmp_path / 'nothing', *usual)
    (tmp_path / 'empty').mkdir()
    assert str(tmp_path / 'empty') in fails(capsys, tmp_path / 'empty', *usual)
    shutil.copytree(bag, tmp_path / 'cut')
    (mcap,) = (tmp_path / 'cut').glob('*.mcap')
    mcap.write_bytes(mcap.read_bytes()[:2000])
    assert 'cut' in fails(capsys, tmp_path / 'cut', *usual)
    (tmp_path / 'table.csv').write_text('t,q\n0,1\n')
    assert '--map' in fails(capsys, tmp_path / 'table.csv', *usual)
    assert 'no.yaml' in fails(capsys, bag, '--robot', tmp_path / 'no.yaml', '--out', out)
    assert not out.exists()


def test_a_recording_to_be_scored_is_read_before_the_work(
    capsys, monkeypatch, bag, model, tmp_path
):
    monkeypatch.setattr(findings, 'diagnose', lambda *_, **__: pytest.fail('worked before'))
    usual = (bag, '--robot', model, '--out', tmp_path / 'out')
    assert 'no such file' in fails(capsys, *usual, '--score', tmp_path / 'nothing')


def test_data_of_another_robot_are_refused(capsys, model, tmp_path):
    stamps = np.arange(0, 10_000_000_000, 10_000_000)
    joints = JointSeries(('shoulder', 'elbow'), stamps, np.zeros((len(stamps), 2)))
    save_npz(Record(joints), tmp_path / 'other.npz')
    err = fails(capsys, tmp_path / 'other.npz', '--robot', model, '--out', tmp_path / 'out')
    assert 'joint' in err


def test_usage_is_checked(capsys):
    assert '--out' in fails(capsys, 'bag', '--robot', ROBOT)
