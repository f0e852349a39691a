"""Every kind of page, of a robot and recordings whose names mean harm, in a real browser."""

from __future__ import annotations

import os
from dataclasses import fields, is_dataclass, replace
from html import escape
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.browser import Browser, needs_chromium
from support.contracts import keeps
from support.diagnosis import hand_made

from spacerobot_ros.batch import single, workers
from spacerobot_ros.cli.main import main
from spacerobot_ros.demo.page import demo_report
from spacerobot_ros.demo.results import DemoResults, DemoRun
from spacerobot_ros.diagnosis.findings import Findings
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.read import read_records
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.report.diagnosis_page import diagnosis_page
from spacerobot_ros.report.html import write_report
from spacerobot_ros.simulation.replay.scene import scene_of

CONFIG = Path(__file__).resolve().parents[2] / 'config'
HOSTILE = '<img src=x onerror=document.title=1>'
JOINT, LINK = f'</script>{HOSTILE}joint', f"']{HOSTILE}link"
RANGES = f'{HOSTILE}.yaml'
KINDS = ('check', 'demo', 'diagnose', 'excite', 'fleet', 'montecarlo', 'show')


def hostile_robot(folder):
    """The servicer, its second joint and link and itself renamed."""
    urdf = (CONFIG / 'servicer.urdf').read_text()
    for old, new in (('joint_2', JOINT), ('link_2', LINK), ('name="servicer"', '')):
        urdf = urdf.replace(old, escape(new) if new else f'name="{escape(HOSTILE)}"')
    (folder / 'servicer.urdf').write_text(urdf)
    content = yaml.safe_load((CONFIG / 'servicer_excite.yaml').read_text())
    values = content['/**']['ros__parameters']
    values['robot'].update(urdf='servicer.urdf', joints=['joint_1', JOINT, 'joint_3'])
    values['excitation'].update(starts=1, iterations=1)
    (folder / 'robot.yaml').write_text(yaml.safe_dump(content))
    return str(folder / 'robot.yaml')


def recorded(folder):
    """Five seconds of it."""
    time = np.arange(0.0, 5.0, 0.02)
    stamps = np.round(time * 1e9).astype(np.int64)
    wave = np.sin(np.outer(time, [1.0, 1.3, 0.7]))
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    rates = np.gradient(wave, 0.02, axis=0)
    joints = JointSeries(('joint_1', JOINT, 'joint_3'), stamps, wave, rates, wave)
    record = Record(joints, RateSeries(stamps, 1e-3 * wave), AttitudeSeries(stamps, still))
    (folder / 'data').mkdir()
    save_npz(record, folder / 'data' / f'{HOSTILE}.npz')
    return str(folder / 'data' / f'{HOSTILE}.npz')


def renamed(value):
    """The same with other names in all of it."""
    if isinstance(value, str):
        return value.replace('joint_2', JOINT).replace('link_3', LINK)
    if isinstance(value, tuple):
        return tuple(renamed(part) for part in value)
    if isinstance(value, dict):
        return {renamed(key): renamed(part) for key, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: renamed(getattr(value, f.name)) for f in fields(value)})
    return value


def answer(question, command):
    """What a diagnosis found, by hand."""
    file = load_robot_file(question.robot)
    diagnosis = renamed(hand_made())
    diagnosis = replace(diagnosis, notes=(HOSTILE,), next_motion=(HOSTILE,))
    return Findings(
        diagnosis=diagnosis,
        file=file,
        records=read_records(question.data, file.robot),
        added=(diagnosis.causes[0].applied,),
        calibration=(),
        closed_loop=None,
        why_open=HOSTILE,
        command=command,
    )


def demonstration(folder, robot, recording):
    time = np.linspace(0.0, 10.0, 50)
    wave = np.sin(time)[:, None] * np.ones(3)
    estimate = Estimate(
        method='online', valid=True, reason='', aam_links=(LINK,), aam=np.full(3, 40.0),
        parameter_names=(HOSTILE,), parameters=np.ones(1), covariance=np.eye(4), rank=4,
        unknowns=4, units=(HOSTILE,), condition=1.0, unexcited=(), total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3), chi2_per_dof=1.0, samples=10, stamp_ns=0,
    )  # fmt: skip
    estimates = tuple(replace(estimate, stamp_ns=k * 10**9) for k in range(10))
    drift = np.full(50, 1e-14)
    run = DemoRun(time, wave, time, wave, drift, drift, estimates)
    truth = np.array([40.0, 40.0, 41.0, 1.0])
    results = DemoResults(HOSTILE, (HOSTILE,) * 3, 1, run, run, run, truth, ('bag',), 1.0)
    file = load_robot_file(robot)
    (record,) = read_records([recording], file.robot)
    report = demo_report(results, lambda: scene_of(record, file, [(JOINT, HOSTILE)]))
    write_report(report, folder / 'demo.html')


@pytest.fixture(scope='module')
def pages(tmp_path_factory):
    """A page of each kind, and what was printed as JSON beside some."""
    folder = tmp_path_factory.mktemp('pages')
    robot, recording = hostile_robot(folder), recorded(folder)
    ranges = {'duration': 0.1, 'seed': 3, 'runs': 2, 'draw': {}}
    ranges['draw'][f'inertia.{LINK}'] = {'distribution': 'uniform', 'loc': 0.8, 'scale': 0.4}
    (folder / RANGES).write_text(yaml.safe_dump(ranges))

    def run(command, *arguments):
        # where an answer belongs beside a page that is replaced, its JSON is read from the file
        assert main([command, *map(str, arguments)]) in (0, 1)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, 'has_dask', lambda: False)
        patch.setattr(single, 'findings', answer)
        run('check', recording, '--robot', robot, '--report', folder / 'check.html')
        run('show', recording, '--robot', robot, '-o', folder / 'show.html')
        page = folder / 'excite.html'
        run('excite', '--robot', robot, '-o', folder / 'motion.yaml', '--report', page)
        run('montecarlo', folder / RANGES, '--robot', robot, '--out', folder / 'monte')
        run('fleet', folder / 'data', '--robot', robot, '--out', folder / 'fleet')
    os.rename(folder / 'monte' / 'report.html', folder / 'montecarlo.html')
    os.rename(folder / 'fleet' / 'report.html', folder / 'fleet.html')
    question = type('Question', (), {'robot': robot, 'data': (recording,)})
    write_report(diagnosis_page(answer(question, HOSTILE)), folder / 'diagnose.html')
    demonstration(folder, robot, recording)
    return folder


@pytest.fixture(scope='module')
def browser():
    with Browser() as running:
        yield running


@pytest.mark.parametrize('kind', KINDS)
def test_no_name_is_a_tag(pages, kind):
    text = (pages / f'{kind}.html').read_text(encoding='utf-8')
    assert HOSTILE not in text.replace(f'"{HOSTILE}', '')
    assert 'onerror' in text


@needs_chromium
@pytest.mark.parametrize(
    ('kind', 'views'),
    [(kind, [(400, 'dark'), (1600, 'light')]) for kind in KINDS]
    + [('diagnose', [(400, 'light'), (1600, 'dark')])],  # with items of every kind
)
def test_every_page_opens_without_an_error(pages, browser, kind, views):
    for width, scheme in views:
        browser.open(pages / f'{kind}.html', width, scheme)
        assert browser.errors == []
        assert browser.ask('document.title') != '1'
        assert browser.ask('document.querySelectorAll("img, [onerror]").length') == 0
        assert browser.ask('document.documentElement.scrollWidth') <= width


def test_printed_json_keeps_its_schema(pages, capsys, monkeypatch):
    monkeypatch.setattr(workers, 'has_dask', lambda: False)
    monkeypatch.setattr(single, 'findings', answer)
    robot = str(pages / 'robot.yaml')
    ranges = ['montecarlo', str(pages / RANGES), '--robot', robot]
    assert main([*ranges, '--out', str(pages / 'monte'), '--json']) == 0
    found = keeps('montecarlo', capsys.readouterr().out)
    assert found['runs'] == 2
    fleet = ['fleet', str(pages / 'data'), '--robot', robot, '--out', str(pages / 'fleet')]
    assert main([*fleet, '--json']) == 1
    (one,) = keeps('fleet', capsys.readouterr().out)['recordings']
    assert one['verdict'] == 'explained'
