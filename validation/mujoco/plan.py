"""What one truth run consists of, before it is built: the replay's plant, and more effects.

Effects have the ids and parameters of docs/effects.md. Those of joints act on the motor and on the
link where a gear gives way between them; dry friction changes its sign smoothly. A body added
inside is taken out of its host, whose rigid limit is the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..replay import effects
from ..replay.effects import Hidden, Values, xyz
from ..replay.plant import Plant, about, text


@dataclass
class Plan(Plant):
    """A truth run to be.

    Args:
        motors: Motor of joints that have one of their own: what MuJoCo's joint has.
        encoder_on_motor: Joints whose encoder sits on the motor.
        fastest: Highest frequency that was brought in [rad/s].
        dry: Largest dry friction by joint, for the choice of the step [N m].
    """

    motors: dict[str, dict[str, Any]] = field(default_factory=dict)
    encoder_on_motor: set[str] = field(default_factory=set)
    fastest: float = 0.0
    dry: dict[str, float] = field(default_factory=dict)

    def mjcf(self) -> str:
        """MuJoCo's model; link angle = motor angle + spring angle, about one axis."""
        model = super().mjcf()
        for joint, own in self.motors.items():
            words = (f'{k}="{v if isinstance(v, str) else text(v)}"' for k, v in own.items())
            spring = f'<joint name="{joint}"'
            model = model.replace(spring, f'<joint {" ".join(words)}/>{spring}')
        return model

    def hide(self, hidden: Hidden) -> None:
        """Bring effects in."""
        for effect, where, values in hidden:
            EFFECTS[effect](self, where, values)
            rates = (values.get(name, 0.0) for name in ('frequency', 'harmonic'))
            self.fastest = max(self.fastest, *rates)  # of a harmonic at 1 rad/s


Effect = Callable[[Plan, Any, Values], None]


def _torque(law: Callable[[float, float, Values], float]) -> Effect:
    """A torque at a joint by its angle and rate."""

    def effect(p: Plan, joint: Any, v: Values) -> None:
        i = p.joints.index(joint)
        p.pushes.append(lambda s: s.push_joint(i, law(s.angle[i], s.rate[i], v)))

    return effect


def _friction(p: Plan, joint: Any, v: Values) -> None:
    """-(c + (s - c) exp(-(v/v_s)^2)) sign(v); the sign is smoothed over `s.stiction` [rad/s]."""
    coulomb = v['coulomb'] if 'coulomb' in v else v['torque']
    static, velocity = v.get('static', coulomb), v.get('velocity', 1.0)
    i = p.joints.index(joint)
    p.dry[joint] = p.dry.get(joint, 0.0) + max(coulomb, static)

    def push(s: Any) -> None:
        size = coulomb + (static - coulomb) * np.exp(-((s.rate[i] / velocity) ** 2))
        s.push_joint(i, -size * np.tanh(s.rate[i] / s.stiction))

    p.pushes.append(push)


def _flexibility(p: Plan, joint: Any, v: Values) -> None:
    """A motor, its rotor as an armature, and a spring to the link, which has the joint's name."""
    spring, rotor = p.joint(joint), v['rotor_inertia']
    motor = {'name': f'{joint}_motor', 'type': spring['type'], 'axis': spring['axis']}
    p.motors[joint] = motor | {'armature': rotor}
    spring.pop('armature', None)
    spring.update(stiffness=v['stiffness'], damping=v['damping'])
    p.fastest = max(p.fastest, np.sqrt(2.0 * v['stiffness'] / rotor), v['damping'] / rotor)
    if v.get('motor_side', 0.0) > 0.5:
        p.encoder_on_motor.add(joint)


def _imbalance(p: Plan, link: Any, v: Values) -> None:
    """A torque that turns about z with a wheel."""

    def push(s: Any) -> None:
        angle = v['frequency'] * s.data.time + v.get('phase', 0.0)
        turning = np.array([np.cos(angle), np.sin(angle), 0.0])
        s.push(link or p.base, s.rotation(link or p.base) @ (v['amplitude'] * turning))

    p.pushes.append(push)


def _appendage(p: Plan, link: Any, v: Values) -> None:
    """A panel; or a boom: a mass, the place of its hinge, and of the mass from there [m]."""
    host = link or p.base
    effects.EFFECTS['flexible_appendage'](p, host, v)
    if 'mass' in v:
        panel = p.bodies[f'{host}_panel']
        axis = panel.joint['axis']
        p.bodies[host].add(panel.mass, panel.pos, panel.inertia)
        mass, lever, panel.pos = v['mass'], xyz(v, 'lever_'), xyz(v, 'at_')
        share = 1.0 - mass * np.sum(np.cross(axis, lever) ** 2) / v['inertia']
        panel.mass, panel.first = mass, mass * lever
        central, panel.inertia = share * panel.inertia, share * panel.inertia + mass * about(lever)
        p.bodies[host].add(mass, panel.pos + lever, central, -1.0)


def _gravity_gradient(p: Plan, _: Any, v: Values) -> None:
    """The tide on every body: force n^2 m (3 r r^T - 1) rho, torque 3 n^2 r x (I r)."""
    r, square = xyz(v) / np.linalg.norm(xyz(v)), v['orbital_rate'] ** 2
    tide = square * (3.0 * np.outer(r, r) - np.eye(3))

    def push(s: Any) -> None:
        arms, axes = s.data.xipos - s.data.subtree_com[0], s.data.ximat.reshape(-1, 3, 3)
        s.data.xfrc_applied[:, :3] = s.model.body_mass[:, None] * (arms @ tide)
        local = np.einsum('bji,j->bi', axes, r)
        torque = np.cross(local, s.model.body_inertia * local)
        s.data.xfrc_applied[:, 3:] = 3.0 * square * np.einsum('bij,bj->bi', axes, torque)

    p.pushes.append(push)


EFFECTS: dict[str, Effect] = effects.EFFECTS | {
    'joint_viscous_friction': _torque(lambda q, qd, v: -v['coefficient'] * qd),
    'joint_coulomb_friction': _friction,
    'joint_stribeck_friction': _friction,
    'joint_torque_ripple': _torque(
        lambda q, qd, v: v['amplitude'] * np.sin(v['harmonic'] * q + v.get('phase', 0.0))
    ),
    'joint_stiffness': _torque(lambda q, qd, v: -v['stiffness'] * (q - v['rest_angle'])),
    'joint_flexibility': _flexibility,
    'wheel_imbalance': _imbalance,
    'flexible_appendage': _appendage,
    'fuel_slosh': lambda p, link, v: effects.EFFECTS['fuel_slosh'](p, link or p.base, v),
    'gravity_gradient': _gravity_gradient,
}
