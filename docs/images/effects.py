"""Draw the signatures in docs/effects.md: `python docs/images/effects.py`.

Every effect acts on one motion of the servicer; drawn is what it adds to the torques, or to what
the sensors say, of a model without it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from spacerobot_ros.dynamics.rotation import rotation_matrix
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effect
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.unknowns.response import Response
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.simulation.plant import Plant
from spacerobot_ros.types import Array

HERE = Path(__file__).parent
PERIOD, DURATION = 0.02, 24.0  # s
EXAMPLES: dict[str, tuple[str | None, dict[str, float]]] = {
    'joint_viscous_friction': ('joint_2', {'coefficient': 3.0}),
    'joint_coulomb_friction': ('joint_2', {'torque': 0.5}),
    'joint_asymmetric_friction': ('joint_2', {'forward': 0.6, 'backward': 0.4}),
    'joint_stribeck_friction': ('joint_2', {'coulomb': 0.5, 'static': 0.9, 'velocity': 0.02}),
    'joint_friction_curvature': ('joint_2', {'torque': 1.0, 'rate': 0.2}),
    'joint_load_friction': ('joint_2', {'coefficient': 0.05}),
    'joint_presliding_friction': ('joint_2', {'torque': 0.5, 'displacement': 0.1}),
    'joint_coupled_friction': ('joint_2', {'coulomb': 0.5, 'viscous': 0.5}),
    'joint_torque_constant': ('joint_2', {'gain': 1.02}),
    'motor_constant': ('joint_2', {'constant': 10.2}),
    'joint_torque_ripple': ('joint_2', {'amplitude': 0.3, 'harmonic': 24.0}),
    'joint_stiffness': ('joint_2', {'stiffness': 2.0, 'rest_angle': 0.1}),
    'motor_inertia': ('joint_2', {'inertia': 1.0}),
    'joint_flexibility': ('joint_2', {'stiffness': 1e4, 'rotor_inertia': 1.0}),
    'joint_backlash': ('joint_2', {'gap': 1e-3}),
    'inertial_parameters': ('link_3', {'mass': 5.0, 'mx': 5.0, 'iyy': 5.0, 'izz': 5.0}),
    'flexible_appendage': (
        'base_link',
        {'inertia': 20.0, 'frequency': 2.5, 'x': 0.0, 'y': 0.0, 'z': 1.0},
    ),
    'grasp_compliance': ('link_3', {'share': 0.9, 'frequency': 6.0}),
    'fuel_slosh': ('base_link', {'mass': 50.0, 'frequency': 1.5, 'x': 0.6, 'y': 0.4}),
    'encoder_offset': ('joint_2', {'offset': 1e-3}),
    'encoder_scale': ('joint_2', {'gain': 1.002}),
    'joint_rate_scale': ('joint_2', {'gain': 1.005}),
    'torque_sensor_bias': ('joint_2', {'bias': 0.3}),
    'current_offset': ('joint_2', {'offset': 0.05}),
    'joint_sensor_delay': ('joint_2', {'delay': 2e-2}),
    'gyro_bias': (None, {'x': 0.0, 'y': 0.0, 'z': 5e-5}),
    'gyro_scale': (None, {'x': 1e-3, 'y': 1e-3, 'z': 1e-3}),
    'gyro_drift': (None, {'x': 0.0, 'y': 0.0, 'z': 1e-6}),
    'gyro_misalignment': (None, {'x': 1e-3, 'y': 0.0, 'z': 0.0}),
    'attitude_misalignment': (None, {'x': 1e-3, 'y': 0.0, 'z': 0.0}),
    'imu_delay': (None, {'delay': 5e-3}),
    'attitude_delay': (None, {'delay': 2e-2}),
    'joint_delay': (None, {'delay': 2e-3}),
    'effort_delay': (None, {'delay': 1e-2}),
    'external_torque_body': (None, {'x': 0.0, 'y': 0.1, 'z': 0.0}),
    'external_torque_inertial': (None, {'x': 0.0, 'y': 0.1, 'z': 0.0}),
    'rotational_drag': (None, {'coefficient': 5.0}),
    'thruster_leak': (
        None,
        {'force_x': 0.1, 'force_y': 0.0, 'force_z': 0.1, 'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4},
    ),
    'thruster_pulses': (
        None,
        {'force_x': 0.0, 'force_y': 5.0, 'force_z': 0.0, 'at_x': 0.8, 'at_y': 0.0, 'at_z': 0.0}
        | {'period': 2.0, 'width': 0.2},
    ),
    'gravity_gradient': (None, {'orbital_rate': 1.1e-3, 'x': 1.0, 'y': 1.0, 'z': 0.0}),
    'gravity_error': (None, {'x': 0.0, 'y': 0.0, 'z': 0.05}),
    'magnetic_dipole': (None, {'x': 5.0, 'y': 0.0, 'z': 0.0}),
    'atmospheric_drag': (None, {'area': 10.0, 'at_x': 0.5, 'at_y': 1.0, 'at_z': 0.0}),
    'solar_pressure': (None, {'area': 20.0, 'at_x': 0.5, 'at_y': 1.0, 'at_z': 0.0}),
    'target_wheel_momentum': ('link_3', {'x': 5.0, 'y': 0.0, 'z': 0.0}),
    'servicer_wheel_momentum_error': (None, {'x': 1.0, 'y': 0.0, 'z': 0.0}),
    'target_wheel_drag': ('link_3', {'time_constant': 300.0}),
    'servicer_wheel_drag': (None, {'time_constant': 300.0}),
    'wheel_imbalance': ('link_3', {'amplitude': 1.0, 'frequency': 8.0}),
    'free_wheel_rotors': ('link_3', {'axial_inertia': 0.5}),
}
LATE = {
    'imu_delay': 'gyro',
    'attitude_delay': 'attitude',
    'joint_delay': 'joint_position',
    'joint_sensor_delay': 'joint_position',
    'effort_delay': 'joint_effort',
}
TARGET_MOMENTUM = np.array([42.0, 49.0, 41.0])  # N m s
SENSORS = {
    'joint_position': ('joint angle', 'rad'),
    'joint_velocity': ('joint rate', 'rad/s'),
    'joint_effort': ('joint torque', 'N m'),
    'gyro': ('gyro', 'rad/s'),
    'attitude': ('attitude', 'rad'),
}


def main() -> None:
    """Draw every example."""
    robot = load_robot_file(HERE.parents[1] / 'config' / 'servicer.yaml').robot
    n = robot.n_joints
    robot = replace(robot, effort_kinds=('current',) * n, motor_constants=(10.0,) * n)  # N m/A
    motion = servicer_motion(robot)
    response = Response(robot, motion)
    spinning = robot.with_target_momentum(TARGET_MOMENTUM)
    among_wheels = Response(spinning, servicer_motion(spinning))
    ground = on_ground(motion)
    held = Response(ground.robot, ground)
    for effect, (where, values) in EXAMPLES.items():
        applied = bind_effect(effect, effect, where, values, robot)
        seen_in = among_wheels if applied.group == 'wheels' else response
        if effect == 'gravity_error':
            seen_in = held
        (HERE / 'effects' / f'{effect}.svg').write_text(
            picture(motion.time, *signature(applied, seen_in)), encoding='utf-8'
        )


def servicer_motion(robot: Robot) -> Motion:
    """A motion with reversals and a sudden stop of all torques after two thirds."""
    n = robot.n_joints
    initial = State(
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.full(n, 0.3),
        np.zeros(3),
        np.array([0.01, 0.02, -0.01]),
        np.zeros(n),
    )
    plant = Plant(robot, initial, PERIOD, 1)
    states, rates, efforts = [], [], []
    for k in range(round(DURATION / PERIOD)):
        t = k * PERIOD
        torque = np.array([80.0, 60.0, 40.0])[:n] * np.sin(0.8 * t + 0.7 * np.arange(n))
        torque *= t < DURATION / 1.5
        states.append(plant.state.to_vector())
        rates.append(plant.dynamics.rate(states[-1], torque))
        efforts.append(torque)
        plant.step(torque)
    x, dx = np.array(states), np.array(rates)
    return Motion(
        robot,
        PERIOD * np.arange(len(x)),
        x[:, 7 : 7 + n],
        x[:, 13 + n :],
        np.array(efforts),
        rotation=np.array([rotation_matrix(row[3:7]) for row in x]),
        omega=x[:, 10 + n : 13 + n],
        velocity=x[:, 7 + n : 10 + n],
        acceleration=dx[:, 7 + n :],
    )


def on_ground(motion: Motion) -> Motion:
    """The joints' part of a motion, with the base held."""
    acceleration = np.array(motion.acceleration)
    acceleration[:, :6] = 0.0
    return Motion(
        replace(motion.robot, is_free=False),
        motion.time,
        motion.q,
        motion.qd,
        motion.effort,
        acceleration=acceleration,
    )


def signature(applied: Effect, response: Response) -> tuple[str, Array]:
    """Label and (N,) values of where the effect shows most."""
    motion = response.motion
    late = LATE.get(applied.id)
    for channel, (label, unit) in SENSORS.items():
        value = {
            'joint_position': motion.q,
            'joint_velocity': motion.qd,
            'joint_effort': motion.effort,
            'gyro': motion.omega,
            'attitude': np.zeros_like(motion.omega),
        }[channel]
        change = applied.sense(channel, value, motion) - value
        if channel == late:
            turned = PERIOD * np.cumsum(motion.omega, axis=0)  # the tracker sees small angles
            seen = turned if channel == 'attitude' else value
            change = -applied.values['delay'] * np.gradient(seen, PERIOD, axis=0)
            if applied.where is not None:
                change *= applied.joint_delays(motion.robot) > 0.0
        if change.any():
            return f'{label} [{unit}]', change[:, np.argmax(np.abs(change).max(axis=0))]
    force = response.force(applied)
    force[:, :3] = 0.0  # newtons, and felt by no sensor of a free base
    column = int(np.argmax(np.ptp(force, axis=0)))
    return 'base torque [N m]' if column < 6 else 'joint torque [N m]', force[:, column]


def picture(time: Array, label: str, values: Array) -> str:
    """A small SVG."""
    with mpl.rc_context({'svg.hashsalt': 'signature', 'font.size': 7, 'svg.fonttype': 'none'}):
        figure = Figure(figsize=(4.2, 1.1), layout='constrained')
        ax = figure.subplots()
        ax.plot(time[::3], values[::3], linewidth=0.9)
        ax.set_xlabel('time [s]')
        ax.set_ylabel(label)
        ax.spines[['top', 'right']].set_visible(False)
        ax.margins(x=0.0)
        path = HERE / 'effects' / 'drawing.svg'
        figure.savefig(path, metadata={'Date': None, 'Creator': None})
    text = path.read_text(encoding='utf-8')
    path.unlink()
    return '\n'.join(line.rstrip() for line in text.splitlines()) + '\n'


if __name__ == '__main__':
    main()
