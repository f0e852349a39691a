"""Windows of a pose: what forces do to them, forwards and backwards."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spacerobot_ros.estimation.pose_rows import PoseRun
from spacerobot_ros.recording.record import AttitudeSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.recording.series import InputSeries
from test.support.lone_body import box_file

PULL = np.array([0.3, -0.2, 0.1])  # N, fixed in space


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """A steady turn about z while a force in space pulls at the centre of mass."""
    robot = box_file(tmp_path_factory.mktemp('box'), com='0.02 0.01 0').robot
    time = 0.06 * np.arange(900)
    turned = Rotation.from_rotvec(np.outer(0.4 * time, [0.0, 0.0, 1.0]))
    centre = np.outer(0.5 * time**2, PULL / 23.0)
    stamps = np.round(time * 1e9).astype(int)
    place = InputSeries(
        ('x', 'y', 'z'), stamps, centre - turned.apply([0.02, 0.01, 0.0]), ('m',) * 3
    )
    record = Record(
        attitudes=AttitudeSeries(stamps, turned.as_quat()), inputs={'base_position': place}
    )
    return PoseRun(in_robot_order(record, robot), robot, ())


def test_a_force_that_is_missing_is_what_is_left(run):
    rows = run.rows(())
    pull = np.einsum('nji,j->ni', rows.motion.rotation, PULL)
    force = np.concatenate([pull, np.cross([0.02, 0.01, 0.0], pull)], axis=1)

    column = rows.whitened(force[..., None], {})[:, 0]

    seen = rows.channel == 0  # the attitude has nothing but rounding left
    scale = np.max(np.abs(column[seen]))
    np.testing.assert_allclose(rows.data[seen], column[seen], atol=1e-6 * scale)
    assert rows.whiteness()[0] < 1e-9


def test_correlation_is_the_product_with_columns(run, rng):
    rows = run.rows(())
    forces = rng.standard_normal((len(rows.motion), 6, 2))
    weights = rng.standard_normal(len(rows.data))

    by = np.einsum('ni,nik->k', rows.force_correlation(weights), forces)

    np.testing.assert_allclose(by, weights @ rows.whitened(forces, {}), rtol=1e-9)
