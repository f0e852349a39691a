"""What an adaptive law has learned, in a file."""

import json

import numpy as np
import pytest
from support.models import H_TARGET, robot_of, table_one

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings
from spacerobot_ros.control.adaptive.parameter_prior import Learned, load, save
from spacerobot_ros.errors import ConfigurationError, RecordingError
from spacerobot_ros.identification.checked_file import digest

TRUE = robot_of(
    table_one(),
    servicer_wheels={'momentum': [25.0, 27.0, 28.0]},
    target_wheels={'links': ['link_3'], 'momentum': H_TARGET.tolist()},
)
SECOND = 1_000_000_000


@pytest.fixture
def learned():
    mean = AdaptiveController(TRUE, AdaptiveSettings(law='adaptive_rls'), 0.01).learned.mean
    return Learned(mean, np.diag(np.linspace(1e-3, 2.0, len(mean))))


def test_comes_back_and_takes_the_place_of_the_prior(tmp_path, learned):
    save(tmp_path / 'f', TRUE, learned, 5 * SECOND)
    back = load(tmp_path / 'f', TRUE, 5 * SECOND)
    np.testing.assert_array_equal(back.mean, learned.mean)
    np.testing.assert_array_equal(back.covariance, learned.covariance)
    controller = AdaptiveController(
        TRUE.with_target_momentum(np.zeros(3)), AdaptiveSettings(law='adaptive_rls'), 0.01
    )
    controller.take(back)
    np.testing.assert_allclose(controller.parameters.values, learned.mean, rtol=1e-12, atol=1e-12)


def test_the_captured_wheels_alone_are_less_certain_with_time(tmp_path, learned):
    save(tmp_path / 'f', TRUE, learned, 0)
    widened = np.diag(load(tmp_path / 'f', TRUE, 33 * SECOND).covariance - learned.covariance)
    np.testing.assert_array_equal(widened[:-3], 0.0)
    # run down with a time constant of 330 s: 1 - exp(-0.1) of it in 33 s
    lost = np.abs(learned.mean[-3:]) * (1.0 - np.exp(-33.0 / 330.0))
    np.testing.assert_allclose(widened[-3:], lost**2, rtol=0.02)


def test_a_torn_file_is_refused_and_the_one_before_used(tmp_path, learned):
    path = tmp_path / 'f'
    save(path, TRUE, learned, 0)
    save(path, TRUE, Learned(2.0 * learned.mean, learned.covariance), 0)
    text = path.read_text()
    for cut in (0, 1, len(text) // 2, len(text) - 3):
        path.write_text(text[:cut])
        np.testing.assert_array_equal(load(path, TRUE, 0).mean, learned.mean)
    (tmp_path / 'f.before').unlink()
    with pytest.raises(RecordingError, match='is damaged'):
        load(path, TRUE, 0)


def test_what_can_not_be_kept_beside_it_does_not_keep_it_from_being_written(tmp_path, learned):
    (tmp_path / 'f').write_text('')
    (tmp_path / 'f.before').mkdir()
    save(tmp_path / 'f', TRUE, learned, 0)
    np.testing.assert_array_equal(load(tmp_path / 'f', TRUE, 0).mean, learned.mean)
    (tmp_path / 'g').mkdir()
    (tmp_path / 'g.before').write_text('')
    with pytest.raises(ConfigurationError, match='can not be written'):
        save(tmp_path / 'g', TRUE, learned, 0)


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda c: c | {'mean': [1.0]}, 'numbers for'),
        (lambda c: c | {'mean': [float('nan'), *c['mean'][1:]]}, 'no finite parameters'),
        (lambda c: c | {'version': 99}, 'is of version 99'),
        (lambda c: c | {'robot': 'x'}, 'of another robot'),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, learned, change, reason):
    save(tmp_path / 'f', TRUE, learned, 0)
    content = json.dumps(change(json.loads(json.loads((tmp_path / 'f').read_text())['content'])))
    (tmp_path / 'f').write_text(json.dumps({'sum': digest(content), 'content': content}))
    with pytest.raises(RecordingError, match=reason):
        load(tmp_path / 'f', TRUE, 0)
