"""What is put on a last link is a body; Pinocchio's regressor of a manipulator as the oracle."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.diagnosis.comparison.changes import exchanged, put_on
from spacerobot_ros.estimation.inference.evidence import Gram

SIZES = np.array([3.0, 0.5, 0.5, 0.5, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2])


def columns(rng, speed, count=60):
    """Return (6 count, 10) torques by the last link's parameters, joints turning at random."""
    model = pin.buildSampleModelManipulator()
    data = model.createData()
    turn = rng.normal(size=(count, 3, model.nv)) * np.array([1.0, speed, speed**2])[:, None]
    every = [pin.computeJointTorqueRegressor(model, data, *state)[:, -10:] for state in turn]
    return np.concatenate(every)


def body(rng):
    """Return the parameters of a lump about somewhere near the flange."""
    mass, size = rng.uniform(0.3, 3.0), rng.uniform(0.02, 0.08)
    inertia = mass * np.diag(rng.uniform(0.6, 1.0, 3)) * size**2
    return pin.Inertia(mass, rng.normal(size=3) * 0.1, inertia).toDynamicParameters()


def put(rng, truth, std, speed=0.5):
    """Return sums of what a change does to noisy torques."""
    by = columns(rng, speed)
    return Gram.of(by / std, (by @ truth + std * rng.normal(size=len(by))) / std)


def test_bodies_have_the_deviations_that_are_said():
    """Put on and taken off in turn; that they are bodies brings them nearer."""
    rng, off, far = np.random.default_rng(3), [], []
    for k in range(16):
        truth = (-1.0) ** k * body(rng)
        gram = put(rng, truth, std=10.0, speed=0.3)
        found = put_on(gram, SIZES)
        alone = np.linalg.solve(gram.matrix + np.diag(SIZES**-2.0), gram.vector)
        off.append((found.values - truth) / found.spread)
        far.append([(x - truth) @ gram.matrix @ (x - truth) for x in (found.values, alone)])
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.all((rms[:4] > 0.6) & (rms[:4] < 1.5))  # mass and first moments, in 16 draws
    assert np.all(rms < 1.5)  # of inertia next to nothing but its size is known
    near, alone = np.mean(far, axis=0)
    assert near < alone


def test_slow_motion_tells_a_mass_that_no_body_has():
    """Inertia is not seen, and the numbers that are come out as no body's, five deviations off."""
    rng = np.random.default_rng(5)
    truth = body(rng)
    gram = put(rng, truth, std=0.3, speed=0.1)
    found = put_on(gram, SIZES)
    parameters = found.values
    pseudo = pin.PseudoInertia.FromDynamicParameters(parameters).toMatrix()
    assert np.min(np.linalg.eigvalsh(pseudo)) > -1e-6
    assert found.values[0] == pytest.approx(truth[0], abs=3.0 * found.spread[0])


def test_what_the_model_misses_widens_a_body():
    """Less inertia than none, by ten deviations: no body, or an error that others have, too."""
    rng = np.random.default_rng(6)
    truth = body(rng)
    gram = put(rng, truth, std=0.3)
    missed = np.zeros(10)
    missed[[4, 6, 9]] = -1.0
    missed *= 10.0 / np.sqrt(missed @ gram.matrix @ missed)
    right, wrong = (
        Gram(gram.matrix, gram.matrix @ x, 0.0, gram.rows) for x in (truth, truth + missed)
    )
    assert put_on(wrong, SIZES) is None
    found = put_on(wrong, SIZES, unexplained=1000.0)
    assert found.values[0] == pytest.approx(truth[0], abs=3.0 * found.spread[0])
    assert found.lost > 10.0
    assert found.spread[0] > 1.5 * put_on(right, SIZES).spread[0]


def test_a_tool_for_another_is_no_body():
    rng = np.random.default_rng(7)
    truth = pin.Inertia(1.0, np.array([0.2, 0.0, 0.0]), 1e-3 * np.eye(3)).toDynamicParameters()
    truth -= pin.Inertia(1.2, np.array([-0.2, 0.0, 0.0]), 1e-3 * np.eye(3)).toDynamicParameters()
    assert put_on(put(rng, truth, std=0.3), SIZES) is None


def test_an_exchanged_body_leaves_one():
    """A tool in place of another: what is there then is a body, however little is seen of it."""
    rng = np.random.default_rng(8)
    file, shared, new = body(rng), body(rng), body(rng)
    truth = new - file - shared
    gram = put(rng, truth, std=0.3)
    found = exchanged(gram, SIZES, file, shared)
    assert abs(found.values[0] - truth[0]) < 3.0 * found.spread[0]
    left = pin.PseudoInertia.FromDynamicParameters(file + shared + found.values).toMatrix()
    assert np.min(np.linalg.eigvalsh(left)) > -1e-6
    far = exchanged(gram, SIZES, file, -3.0 * file)  # no body before: the file's counts
    left = pin.PseudoInertia.FromDynamicParameters(file + far.values).toMatrix()
    assert np.min(np.linalg.eigvalsh(left)) > -1e-6
