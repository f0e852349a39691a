"""Reduced equation rebuilt from an estimate, against two other derivations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.identification import carried, inertia_of, joint_names, servicer
from support.models import (
    DUAL_ARM,
    H_BASE,
    H_TARGET,
    random_tree,
    robot_of,
    table_one,
)

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.identification.reduced import EstimatedDynamics

RELATIVE = 1e-11  # the requirement


def perfect_estimate(robot, structure, aam):
    """Return the estimate that knows the truth."""
    minimal = minimal_set(robot, structure)
    x = minimal.of_robot(robot)
    return Estimate(
        method='ml',
        valid=True,
        reason='',
        aam_links=tuple(g.link for g in robot.target_wheels),
        aam=aam,
        parameter_names=minimal.names,
        parameters=x,
        covariance=np.eye(len(aam) + len(x)),
        rank=len(aam) + len(x),
        unknowns=len(aam) + len(x),
        units=minimal.units,
        condition=1.0,
        unexcited=(),
        total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3),
        chi2_per_dof=1.0,
        samples=1,
        stamp_ns=0,
    )


def worst_difference(robot, rebuilt, rng, *, joint_reaction=True):
    """Largest relative difference of H and c at 200 random states."""
    n = robot.n_joints
    dynamics = Dynamics(robot, joint_reaction=joint_reaction)
    worst = 0.0
    for _ in range(200):
        q, qd, w = rng.uniform(-3.0, 3.0, n), rng.standard_normal(n), rng.standard_normal(3)
        state = State(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), q, np.zeros(3), w, qd)
        want = dynamics.reduced(dynamics.at_rest_centre(state))
        got = rebuilt.reduced(q, qd, w, joint_reaction)
        for a, b in ((got.H, want.H), (got.c, want.c)):
            worst = max(worst, np.max(np.abs(a - b)) / np.max(np.abs(b)))
    return worst


@pytest.mark.parametrize('joint_reaction', [True, False])
@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize('axes', ['zyx', 'xyy', 'zyy'])
def test_table_one(axes, structure, joint_reaction, rng):
    model = servicer(axes)
    truth = model.with_target_momentum(H_TARGET)
    rebuilt = EstimatedDynamics.from_estimate(
        model, structure, perfect_estimate(model, structure, H_TARGET)
    )
    assert worst_difference(truth, rebuilt, rng, joint_reaction=joint_reaction) <= RELATIVE


TREES = {
    'one': ([0], ()),
    'branch': ([0, 1, 1, 2], ()),
    'dual': (DUAL_ARM, ()),
    'a slide': ([0], (1,)),
    'slides': ([0, 1, 1, 2], (2, 3)),
}


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize(('parents', 'slides'), TREES.values(), ids=TREES.keys())
def test_any_tree_with_wheels_on_two_links(parents, slides, structure, rng):
    parts = random_tree(rng, parents, slides)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    links = sorted({'link_1', parts[-1].name})
    aam = rng.standard_normal(3 * len(links))
    model = robot_of(
        parts,
        joints,
        servicer_wheels={'momentum': [0.3, -0.2, 0.5]},
        target_wheels={'links': links, 'momentum': [0.0] * len(aam)},
    )
    rebuilt = EstimatedDynamics.from_estimate(
        model, structure, perfect_estimate(model, structure, aam)
    )
    assert worst_difference(model.with_target_momentum(aam), rebuilt, rng) <= RELATIVE


def test_against_finite_differences_of_the_lagrangian(rng):
    # Hamel's equations of T(q, u), u = [w; q'], and the wheels' gyroscopic torques.
    parts, model = table_one('zyx'), servicer('zyx')
    order = joint_names(parts)
    rebuilt = EstimatedDynamics.from_estimate(
        model, 'symmetric', perfect_estimate(model, 'symmetric', H_TARGET)
    )
    step = 1e-4
    for _ in range(5):
        q, qd, w = rng.uniform(-3.0, 3.0, 3), rng.standard_normal(3), rng.standard_normal(3)
        u = np.concatenate([w, qd])
        M = inertia_of(parts, order, q)
        slopes = [
            (inertia_of(parts, order, q + d) - inertia_of(parts, order, q - d)) / (2.0 * step)
            for d in step * np.eye(3)
        ]
        bias = np.tensordot(qd, slopes, axes=1) @ u
        R = carried(parts, order, q, 3)
        axes = [carried(parts, order, q, j + 1) @ parts[j + 1].axis for j in range(3)]
        torque = np.cross(w + np.column_stack(axes) @ qd, R @ H_TARGET)
        bias[:3] += np.cross(w, M[:3] @ u + H_BASE) + torque
        bias[3:] += np.column_stack(axes).T @ torque - [0.5 * u @ s @ u for s in slopes]
        base = np.linalg.solve(M[:3, :3], np.column_stack([M[:3, 3:], bias[:3]]))
        got = rebuilt.reduced(q, qd, w)
        want_H = M[3:, 3:] - M[3:, :3] @ base[:, :3]
        np.testing.assert_allclose(got.H, want_H, rtol=0, atol=RELATIVE * np.max(want_H))
        # central differences: step^2 = 1e-8 of 1e4 kg m^2
        np.testing.assert_allclose(got.c, bias[3:] - M[3:, :3] @ base[:, 3], rtol=0, atol=1e-3)


def refused(estimate, match, structure='symmetric'):
    with pytest.raises(IdentificationError, match=match):
        EstimatedDynamics.from_estimate(servicer(), structure, estimate)


def test_estimates_that_are_refused():
    good = perfect_estimate(servicer(), 'symmetric', H_TARGET)
    EstimatedDynamics.from_estimate(servicer(), 'symmetric', good)
    renamed = ('other', *good.parameter_names[1:])
    refused(replace(good, parameter_names=renamed), 'parameters are not the 19 of this robot')
    refused(good, r'its 19 parameters are not the 45 .*generic', 'generic')
    refused(replace(good, aam_links=('link_2',)), r'link_2.*the model has them on.*link_3')
    refused(replace(good, aam_links=('link_2', 'link_3')), 'sizes')
    refused(replace(good, parameters=good.parameters[1:]), 'sizes')
    refused(replace(good, covariance=np.eye(3)), r'covariance is \(3, 3\), expected \(22, 22\)')
    refused(replace(good, covariance=-good.covariance), 'negative variance')
    for name in ('aam', 'parameters', 'covariance'):
        values = getattr(good, name).copy()
        values.flat[0] = np.nan
        refused(replace(good, **{name: values}), 'not finite')


def test_indefinite_inertia_is_refused_at_the_state():
    good = perfect_estimate(servicer(), 'symmetric', H_TARGET)
    rebuilt = EstimatedDynamics.from_estimate(
        servicer(), 'symmetric', replace(good, parameters=-good.parameters)
    )
    with pytest.raises(IdentificationError, match='not positive definite'):
        rebuilt.reduced(np.zeros(3), np.zeros(3), np.zeros(3))


def test_estimate_as_plain_data():
    estimate = perfect_estimate(servicer(), 'symmetric', H_TARGET)
    data = estimate.to_dict()
    assert data['aam'] == {
        'value': list(H_TARGET),
        'std': [1.0, 1.0, 1.0],
        'unit': 'N m s',
        'links': ['link_3'],
        'source': [None] * 3,
    }
    assert [p['name'] for p in data['parameters']] == list(estimate.parameter_names)
    assert {p['unit'] for p in data['parameters']} == {'kg m^2'}
    assert data['unknowns'] == data['rank'] == 22
    assert data['momentum']['frame'] == 'inertial'
