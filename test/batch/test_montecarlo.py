"""`spacerobot montecarlo`: ranges, the two kinds of runs beside each other, replay, bad input."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
import yaml

from spacerobot_ros.batch import workers
from spacerobot_ros.batch.montecarlo_trial import (
    ACCURACY,
    LARGEST,
    closed_loop,
    closed_loop_row,
    dynamics_rows,
    steps_of,
)
from spacerobot_ros.batch.ranges import Ranges, load_ranges
from spacerobot_ros.cli.main import main
from spacerobot_ros.errors import ConfigurationError

ROBOT = str(Path(__file__).resolve().parents[2] / 'config' / 'servicer.yaml')
DRAW = {
    'inertia.link_3': {'distribution': 'uniform', 'loc': 0.8, 'scale': 0.4},
    'truth.target_momentum[0]': {'distribution': 'norm', 'loc': 42.0, 'scale': 5.0},
}


def written(path, **content):
    path.write_text(yaml.safe_dump({'duration': 2.0, 'seed': 3, 'draw': DRAW, **content}))
    return str(path)


@pytest.fixture
def ranges(tmp_path):
    return load_ranges(written(tmp_path / 'ranges.yaml'), ROBOT, 20)


def test_draws_follow_their_distributions_whatever_else_is_drawn(ranges):
    values = [ranges.values(run) for run in range(400)]
    for key, law in (
        ('inertia.link_3', scipy.stats.uniform(0.8, 0.4)),
        ('truth.target_momentum[0]', scipy.stats.norm(42.0, 5.0)),
    ):
        assert scipy.stats.kstest([v[key] for v in values], law.cdf).pvalue > 1e-3
        alone = replace(ranges, draw={key: ranges.draw[key]})
        assert alone.values(7)[key] == ranges.values(7)[key]


def test_the_machine_has_what_is_drawn_and_its_controller_does_not_know(ranges):
    values = ranges.values(5)
    loop, steps = closed_loop(ranges, 5)
    assert steps == 200
    robot, plant = ranges.robot_file.robot, loop.plant.robot
    body = [b.name for b in robot.bodies].index('link_3')
    factor = values['inertia.link_3']
    np.testing.assert_allclose(  # once to pinocchio's body and back
        plant.inertial_parameters[body], factor * robot.inertial_parameters[body], rtol=1e-12
    )
    assert plant.target_momentum[0] == values['truth.target_momentum[0]']
    believed = loop.controller.robot
    np.testing.assert_array_equal(believed.inertial_parameters, robot.inertial_parameters)
    assert believed.target_momentum[0] == robot.target_momentum[0]


def test_dynamics_alone_are_the_closed_loop_of_ever_shorter_periods(ranges, tmp_path):
    """A held torque is late by half a period: the difference falls with the period's square."""
    (alone,) = dynamics_rows(ranges, [4])
    assert alone[LARGEST] > 1e-3
    missed = []
    for period in (0.02, 0.01):
        content = yaml.safe_load(Path(ROBOT).read_text())
        values = content['/**']['ros__parameters']
        rate = 1.0 / period
        values['simulator'].update(period=period, noise=False, joint_rate=rate, imu_rate=rate)
        values['robot']['urdf'] = ROBOT.replace('.yaml', '.urdf')
        path = tmp_path / f'{period}.yaml'
        path.write_text(yaml.safe_dump(content))
        row = closed_loop_row(replace(ranges, robot_path=str(path)), 4)
        missed.append(abs(row[LARGEST] - alone[LARGEST]) / alone[LARGEST])
    assert missed[1] < 0.6 * missed[0] < 0.03


def test_a_run_does_not_depend_on_which_others_there_are(ranges):
    together = dynamics_rows(ranges, range(20))
    assert dynamics_rows(ranges, [13]) == [together[13]]
    assert dynamics_rows(ranges, [4, 13, 2])[1] == together[13]


def test_steps_are_short_enough(ranges):
    assert steps_of(ranges) < 200
    rows = dynamics_rows(ranges, range(4))
    steps = 4 * steps_of(ranges)
    from spacerobot_ros.batch import montecarlo_trial

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(montecarlo_trial, 'steps_of', lambda _: steps)
        exact = dynamics_rows(ranges, range(4))
    for row, best in zip(rows, exact, strict=True):
        assert abs(row[LARGEST] - best[LARGEST]) < ACCURACY


def table(path):
    with path.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def test_the_command_goes_on_and_the_worst_run_is_replayed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(workers, 'has_dask', lambda: False)
    path = written(tmp_path / 'ranges.yaml', runs=6, duration=0.2)
    out = tmp_path / 'out'
    command = ['montecarlo', path, '--robot', ROBOT, '--out', str(out)]
    assert main(command) == 0
    rows = table(out / 'runs.csv')
    assert [row['run'] for row in rows] == list('012345')
    median = next(r for r in table(out / 'percentiles.csv') if r['result'] == LARGEST)
    values = [float(row[LARGEST]) for row in rows]
    assert float(median['p50']) == pytest.approx(np.median(values), rel=1e-12)
    before = (out / 'runs.csv').read_bytes()
    (out / 'runs.csv').unlink()
    with (out / 'montecarlo.jsonl').open('r+b') as file:  # as a killed client leaves it
        file.truncate(file.seek(0, 2) - 5)
    capsys.readouterr()
    assert main(command) == 0
    assert (out / 'runs.csv').read_bytes() == before
    printed = capsys.readouterr().out
    worst = int(np.argmax(values))
    words = f'--replay {worst}'
    assert words in printed
    assert main([*command, '--replay', str(worst)]) == 0
    assert str(values[worst]) in capsys.readouterr().out
    assert (out / f'run_{worst}' / 'metadata.yaml').is_file()


@pytest.mark.parametrize(
    ('change', 'why'),
    [
        ({'draw': {'sensors.gyro': DRAW['inertia.link_3']}}, 'gyro'),
        ({'draw': {'inertia.link_9': DRAW['inertia.link_3']}}, 'no such body'),
        ({'draw': {'truth.target_momentum[7]': DRAW['inertia.link_3']}}, 'no such entry'),
        ({'draw': {'sensors.gyro_std': {'distribution': 'normal'}}}, 'no distribution'),
        ({'draw': {'sensors.gyro_std': {'distribution': 'norm', 'mean': 1.0}}}, 'norm: '),
        ({'draw': {'sensors.gyro_std': 3.0}}, 'expected {distribution'),
        ({'draw': [1]}, "expected a map with 'draw'"),
        ({'runs': -3}, 'above zero'),
        ({'speed': 1}, 'unknown key'),
        ({'effects': [1]}, 'effects: expected a map'),
    ],
)
def test_bad_ranges(tmp_path, change, why):
    with pytest.raises(ConfigurationError, match=why):
        load_ranges(written(tmp_path / 'ranges.yaml', **change), ROBOT)


def test_a_value_that_can_not_be_costs_its_run_only(tmp_path):
    law = {'distribution': 'norm', 'loc': 1e-5, 'scale': 1e-5}
    path = written(tmp_path / 'r.yaml', duration=0.05, draw={'sensors.gyro_std': law}, seed=5)
    ranges = load_ranges(path, ROBOT)
    negative = next(k for k in range(99) if ranges.values(k)['sensors.gyro_std'] < 0.0)
    assert 'gyro_std' in closed_loop_row(ranges, negative)['error']


@pytest.mark.parametrize(
    ('more', 'why'),
    [
        ({'draw': {'sensors.gyro_std': DRAW['inertia.link_3']}}, 'means nothing to dynamics'),
        (
            {
                'effects': {
                    'worn': {
                        'effect': 'joint_viscous_friction',
                        'where': 'joint_2',
                        'coefficient': 1.0,
                    }
                }
            },
            'is a force',
        ),
    ],
)
def test_what_dynamics_alone_do_not_have(tmp_path, capsys, more, why):
    path = written(tmp_path / 'r.yaml', **more)
    command = ['montecarlo', path, '--robot', ROBOT, '-o', str(tmp_path / 'o'), '--dynamics']
    assert main(command) == 2
    assert why in capsys.readouterr().err
    assert isinstance(load_ranges(path, ROBOT), Ranges)
