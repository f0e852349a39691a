"""Arms whose file has links of another mass: the mass is named, not what does nearly as well."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import lfilter

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

LINKS = ((3.0, 0.25, 0.05), (2.0, 0.2, 0.03))  # kg, m to the centre of mass, kg m^2 about it
RATE = 100.0  # Hz


def urdf(scales):
    """A chain that hangs in a plane, 0.4 m from joint to joint, links so many times as heavy."""
    out, parent, at = ['<robot name="chain"><link name="base_link"/>'], 'base_link', 0.0
    for k, (scale, (mass, place, moment)) in enumerate(zip(scales, LINKS, strict=False), 1):
        tensor = f'ixx="{moment * scale}" iyy="{moment * scale}" izz="{0.2 * moment * scale}"'
        out.append(
            f'<link name="link_{k}"><inertial><origin xyz="0 0 {-place}"/>'
            f'<mass value="{mass * scale}"/><inertia {tensor} ixy="0" ixz="0" iyz="0"/></inertial>'
            f'</link><joint name="joint_{k}" type="revolute">'
            f'<parent link="{parent}"/><child link="link_{k}"/>'
            f'<axis xyz="0 1 0"/><origin xyz="0 0 {at}"/>'
            '<limit lower="-6" upper="6" effort="100" velocity="5"/></joint>'
        )
        parent, at = f'link_{k}', -0.4
    return '\n'.join([*out, '</robot>'])


def recorded(joints, gravity):
    """24 s of a motion, friction and a leftover of 6 % of it that lasts for a second."""
    rng = np.random.default_rng([1, 77])
    time = np.arange(round(24.0 * RATE) + 1) / RATE
    w = 2.0 * np.pi * 0.1 * np.arange(1, 6)
    size, turn = rng.standard_normal((2, joints, 5))
    sine, cosine = np.sin(time[:, None] * w), np.cos(time[:, None] * w)
    scale = 1.5 / np.max(np.abs(cosine @ size.T + sine @ turn.T), axis=0)
    q = scale * ((sine / w) @ size.T - (cosine / w) @ turn.T)
    qd = scale * (cosine @ size.T + sine @ turn.T)
    qdd = scale * ((-sine * w) @ size.T + (cosine * w) @ turn.T)
    model = pin.buildModelFromXML(urdf([1.0] * joints))
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    dry = 0.5 * np.sqrt(np.mean(torque**2, axis=0))
    torque = torque + dry * np.tanh(qd / 2e-3) + 0.4 * dry * qd
    keep, drive = np.exp(-1.0 / RATE), rng.standard_normal(q.shape)
    slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], drive, axis=0)
    torque += dry * (0.06 * slow + 5e-3 * rng.standard_normal(q.shape))
    q = q + 2e-5 * rng.standard_normal(q.shape)
    names = tuple(f'joint_{k + 1}' for k in range(joints))
    return Record(joints=JointSeries(names, to_stamps(time), q, None, torque))


def robot(scales, gravity):
    own = {'base': 'fixed', 'gravity': [0.0, 0.0, -gravity]}
    own['joints'] = [f'joint_{k + 1}' for k in range(len(scales))]
    return build_robot(parse_settings({'robot': own}), urdf(scales))


@pytest.mark.parametrize('gravity', [9.81, 0.0])
@pytest.mark.parametrize('scales', [(2.0,), (0.5,), (1.0, 2.0), (2.0, 2.0), (0.5, 0.5)])
def test_the_last_link_s_mass_is_named_and_no_torque_constant(scales, gravity):
    """Gains of 2 and ripples were; what a lone joint without weight lacks may be its rotor."""
    found = diagnose(recorded(len(scales), gravity), robot(scales, gravity))
    last = len(scales)
    named = {(c.applied.id, c.applied.where): c for c in found.causes}
    kinds = {kind for kind, _ in named}
    assert not {'joint_torque_constant', 'joint_torque_ripple', 'joint_stiffness'} & kinds
    if (scales, gravity) == ((0.5,), 0.0):
        rivals = [(r.effect, r.where) for r in named['motor_inertia', 'joint_1'].rivals]
        assert ('inertial_parameters', 'link_1') in rivals
        return
    found = named['inertial_parameters', f'link_{last}'].parameters
    mass, place, moment = LINKS[last - 1]
    # about its joint, which its motion tells: a mass at the joint may as well be the link's before
    true = (1.0 - scales[-1]) * (mass * place**2 + moment)
    assert abs(found['iyy'].value - true) < 3.0 * found['iyy'].std < 0.9 * abs(true)
    if scales[:-1] == (1.0,) * (last - 1):
        lost = (1.0 - scales[-1]) * mass
        assert abs(found['mass'].value - lost) < 3.0 * found['mass'].std


def test_a_mass_that_a_torque_constant_may_be_says_so():
    """A lone joint tells them apart by what is plausible alone."""
    (cause,) = (
        c
        for c in diagnose(recorded(1, 9.81), robot((1.7,), 9.81)).causes
        if not c.applied.id.endswith('_friction')
    )
    named = {(cause.applied.id, cause.applied.where)}
    named |= {(r.effect, r.where) for r in cause.rivals}
    assert named >= {('inertial_parameters', 'link_1'), ('joint_torque_constant', 'joint_1')}
