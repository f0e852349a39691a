"""Draws the sizes in `records.jsonl` by the detection limits of commit 0b820b9, with whose package it runs.

    PYTHONPATH=CHECKOUT_OF_0b820b9:. python validation/replay/draw.py NUMBER >> lines

Sizes were drawn once, are numbers since, and this file goes with the next commit: a later engine has other limits.
"""

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from spacerobot_ros.campaign.hidden.arm_campaign import _drawn, _fits
from spacerobot_ros.campaign.hidden.diagnosis_draw import drawn, places
from spacerobot_ros.diagnosis.arms.arms import find_arm_causes
from spacerobot_ros.diagnosis.comparison.compare import compare
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.read import read_record
from validation.replay import records
from validation.replay.plant import EFFECTS

FLIGHT = [e for e in EFFECTS if e != 'gravity_error']
THREE = ('servicer', 'minisat', 'twin')
MOTIONS = ('default', 'fast', 'slow')
FLYER = [
    'joint_viscous_friction',
    'joint_coulomb_friction',
    'motor_inertia',
    'inertial_parameters',
    'joint_stiffness',
    'joint_torque_ripple',
    'joint_torque_constant',
    'encoder_offset',
    'flexible_appendage',
]
ARM = [
    'joint_coulomb_friction',
    'joint_viscous_friction',
    'joint_stiffness',
    'motor_inertia',
    'payload',
    'torque_sensor_bias',
    'joint_torque_ripple',
    'effort_delay',
    'gravity_error',
    'body',
    'payload',
    'joint_coulomb_friction',
]
CHANGE = [
    'payload',
    'joint_coulomb_friction',
    'joint_viscous_friction',
    'joint_stiffness',
    'torque_sensor_bias',
    'motor_inertia',
    'joint_torque_constant',
    'payload',
]


def plan():
    """Key, machine, seed, motion, asked, wanted effects, multiple."""
    out = []
    for k in range(12):
        out.append(
            (
                f'hidden-clean-{k:02}',
                THREE[k % 3],
                1000 + k,
                MOTIONS[k // 3 % 3],
                'diagnose',
                [],
                0,
            )
        )
    hard = [
        'joint_coulomb_friction',
        'joint_torque_ripple',
        'flexible_appendage',
        'inertial_parameters',
        'joint_torque_constant',
        'thruster_leak',
        'encoder_offset',
        'joint_delay',
    ]
    for k, (e, x) in enumerate([(e, 3) for e in FLIGHT] + [(e, 10) for e in hard]):
        machine = THREE[k % 3]
        if e.startswith(('target', 'servicer')) and machine == 'minisat':
            machine = 'servicer'
        out.append(
            (f'hidden-single-{k:02}', machine, 1100 + k, MOTIONS[k // 3 % 3], 'diagnose', [e], x)
        )
    rng = np.random.default_rng(1)
    usable = [e for e in FLIGHT if not e.startswith(('target', 'servicer'))]
    for k in range(12):
        size = 2 if k < 8 else 3
        chosen = [str(e) for e in rng.choice(usable, size, replace=False)]
        out.append(
            (
                f'hidden-{"pair" if size == 2 else "triple"}-{k:02}',
                THREE[k % 3],
                1200 + k,
                MOTIONS[k // 3 % 3],
                'diagnose',
                chosen,
                10 if k % 2 or size == 3 else 3,
            )
        )
    for k in range(12):
        out.append(
            (
                f'flyer-{k:02}',
                'flyer',
                2000 + k,
                MOTIONS[k % 2],
                'diagnose',
                [] if k < 3 else [FLYER[k - 3]],
                3 if k % 2 else 10,
            )
        )
    for k in range(16):
        out.append(
            (f'arm-{k:02}', 'arm', 3000 + k, '', 'diagnose', [] if k < 4 else [ARM[k - 4]], 3)
        )
    for k in range(12):
        out.append(
            (f'change-{k:02}', 'arm', 3100 + k, '', 'compare', [] if k < 4 else [CHANGE[k - 4]], 3)
        )
    for k in range(12):
        out.append((f'identify-{k:02}', 'client', 4000 + k, 'long', 'identify', ['h'], 0))
    out.append(('check-servicer', 'servicer', 5000, 'default', 'check', [], 0))
    out.append(('check-arm', 'arm', 5001, '', 'check', [], 0))
    return out


def line_of(key, machine, seed, motion, asked, effects, multiple):
    line = {'key': key, 'asked': asked, 'machine': machine, 'seed': seed}
    if motion:
        line['motion'] = motion
    rng = np.random.default_rng([seed, 11])
    if asked == 'identify':
        direction = rng.standard_normal(3)
        h = rng.uniform(0.5, 5.0) * direction / np.linalg.norm(direction)
        n = 2 + seed % 5
        line |= {'seconds': 40.0, 'bodies_off': (0.0, 0.1, 0.3)[seed % 3]}
        effect = {
            'effect': 'target_wheel_momentum',
            'where': f'b{n}',
            'values': dict(zip('xyz', h.tolist())),
        }
        return line | {'hidden': [effect]}
    if not effects:
        return line
    with tempfile.TemporaryDirectory() as folder:
        records.check = lambda *_: None
        own = records.made(line, Path(folder))
        file = load_robot_file(own / 'robot.yaml')
        read = lambda name: observed(
            read_record(own / f'{name}.npz', file.robot, own / 'map.yaml'), file.robot
        )
        measured = read('data')
        if machine == 'arm':
            hidden = in_arm(line, file, measured, read, effects[0], rng)
        else:
            hidden = in_flight(file.robot, measured, effects, multiple, rng)
    line['times_limit'] = [x for _, x in hidden]
    line['hidden'] = [
        {'effect': h.id, 'where': h.where, 'values': {k: float(v) for k, v in h.values.items()}}
        for h, _ in hidden
    ]
    return line


def in_flight(robot, measured, effects, multiple, rng):
    clean = Fit(Run(measured, robot, (), noise_levels(robot.sensors, measured)[0]), ())
    out = []
    for effect in effects:
        where = [w for e, w in places(robot) if e == effect]
        for _ in range(6):  # another place or direction where bounds leave no room
            place = where[int(rng.integers(len(where)))]
            found, strength = drawn(clean, effect, place, multiple, rng)
            if strength >= 0.99 * multiple:
                break
        out.append((found, strength))
    return out


def in_arm(line, file, measured, read, cause, rng):
    if line['asked'] == 'compare':
        selection = compare([read('before')], [measured], file.robot, file.effects).selection
    else:
        kinds = list(CATALOGUE.values())
        selection = find_arm_causes(
            [measured], file.robot, file.effects, kinds, lambda *_: None
        ).selection
    import spacerobot_ros.campaign.hidden.arm_campaign as campaign

    campaign._LAST = f'b{file.robot.n_joints}'
    for _ in range(8):
        hidden = campaign._drawn(selection, cause, rng)
        if hidden is not None:
            return [(hidden, 3.0)]
    raise SystemExit(f'{line["key"]}: {cause} can not be hidden')


print(json.dumps(line_of(*plan()[int(sys.argv[1])])), flush=True)
