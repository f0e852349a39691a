"""Measured data with a hidden cause, from MuJoCo: no code of the product's dynamics in it.

    case = generate('servicer', [('joint_viscous_friction', 'joint_2', {'coefficient': 3.0})],
                    folder=tmp_path, seed=3, bag=True)

`case.robot` is the robot file that a user would have, `case.data` the bag (or the `Record`), and
`case.hidden` what must be found: a test reads it after the verdict. Robots are `ROBOTS` or one's
own; effects are `EFFECTS` of `plan.py`, one or several, of one kind or many; excitations are
`EXCITATIONS` of `run.py`, or one's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from spacerobot_ros.recording.record import Record

from ..replay.effects import Hidden
from ..replay.machines import Machine, machine, own_bodies
from .plan import Plan
from .run import EXCITATIONS, Excitation, History, Seen, simulate
from .sensors import RATES, Sensors, noise_of, sample, stream, to_record, write_bag

_HERE = Path(__file__).with_name('robots')


def robot_of(urdf: str, joints: Sequence[str], q0: Sequence[float], **further: Any) -> Machine:
    """A robot whose root link is `base_link`; `further` as of `Machine`."""
    own = {'base': 'base_link', 'free': True, **further}
    return Machine(urdf, tuple(joints), q0=np.array(q0), **own)


def _known() -> dict[str, Machine]:
    described = yaml.safe_load((_HERE / 'robots.yaml').read_text(encoding='utf-8'))
    texts = {name: (_HERE / f'{name}.urdf').read_text(encoding='utf-8') for name in described}
    own = {name: robot_of(texts[name], **entry) for name, entry in described.items()}
    return {'servicer': machine('servicer', 0), **own}


ROBOTS = _known()
"""By name: the packaged servicer, and those of `robots.yaml`."""


@dataclass(frozen=True, eq=False)
class Case:
    """What a user has, and what is hidden from him.

    Args:
        robot: The robot file.
        data: Bag folder, or record.
        hidden: The effects: (id, where, parameters).
        history: The true states, for tests of the generator itself.
    """

    robot: Path
    data: Path | Record
    hidden: Hidden
    history: History


def generate(
    robot: str | Machine,
    effects: Hidden = (),
    *,
    folder: Path,
    seed: int = 0,
    duration: float = 40.0,
    excitation: str | Excitation = 'default',
    noise: bool = True,
    sensors: Sensors | None = None,
    bag: bool = False,
) -> Case:
    """Simulate, sample, and write the robot file; the same arguments give the same data.

    Args:
        robot: A key of `ROBOTS`, or a robot.
        effects: (id, where, parameters); `where` is None for the system as a whole.
        folder: Where robot file and bag go.
        seed: Of motion and noise.
        duration: [s].
        excitation: A key of `EXCITATIONS`, or a motion.
        noise: Whether sensors have noise.
        sensors: By default with the robot's `effort_std`.
        bag: Write a rosbag2 folder rather than return a record.
    """
    what = ROBOTS[robot] if isinstance(robot, str) else robot
    motion = EXCITATIONS[excitation] if isinstance(excitation, str) else excitation
    sensors = sensors or Sensors(effort_std=what.effort_std)
    plan = planned(what, effects)
    errors = noise_of(sensors, seed, len(plan.joints), duration, noise)
    seen = _seen(plan, motion, errors)
    history = simulate(plan, what, motion, duration, stream(seed, 20), seen)
    held = motion.period_control if motion.control == 'held' else None
    sampled = sample(plan, history, errors, held, sensors.effort_mean)
    record = to_record(plan, *sampled, f'truth of seed {seed}')
    path = write_robot(what, sensors, folder)
    data = write_bag(record, folder / f'bag_{seed}', what.base) if bag else record
    return Case(path, data, effects, history)


def planned(robot: Machine, effects: Hidden) -> Plan:
    """The plan of a robot with its hidden effects."""
    as_it_is = robot.plant(own_bodies(robot), ())
    plan = Plan(**vars(as_it_is))
    plan.hide(effects)
    return plan


def write_robot(robot: Machine, sensors: Sensors, folder: Path) -> Path:
    """Robot file and URDF."""
    own: dict[str, Any] = {
        'urdf': 'robot.urdf',
        'base': 'free' if robot.free else 'fixed',
        'base_link': robot.base,
        'gravity': [0.0, 0.0, 0.0 if robot.free else -9.81],
        'joints': list(robot.joints),
    }
    if robot.free:
        own['servicer_wheels'] = {'momentum': list(map(float, robot.wheels))}
    if robot.target:
        believed = list(map(float, robot.momentum))
        own['target_wheels'] = {'links': [robot.target], 'momentum': believed}
    stds = dict(list(sensors.stds.items())[: None if robot.free else 3])
    content = {'/**': {'ros__parameters': {'robot': own, 'sensors': stds}}}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'robot.urdf').write_text(robot.urdf, encoding='utf-8')
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding='utf-8')
    return path


def _seen(plan: Plan, motion: Excitation, errors: dict[str, np.ndarray]) -> Seen:
    """What a controller that reads the sensors is told: the very samples that are recorded."""
    past: list[tuple[np.ndarray, np.ndarray]] = []
    late = round(plan.delays.get('joints', 0.0) / motion.period_control)
    ratio = RATES['q'] * motion.period_control

    def seen(k: int, sim: Any) -> tuple[np.ndarray, np.ndarray]:
        past.append((sim.angle.copy(), sim.rate.copy()))
        q, qd = (x[None].copy() for x in past[max(k - late, 0)])
        told = {'q': q, 'qd': qd, 'tau': np.zeros_like(q)}
        told |= {'omega': np.zeros((1, 3)), 'attitude': np.eye(3)[None]}
        for mend in plan.mends:
            mend(told)
        row = min(round(k * ratio), len(errors['q']) - 1)
        return told['q'][0] + errors['q'][row], told['qd'][0] + errors['qd'][row]

    return seen
