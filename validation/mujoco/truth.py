"""Measured data with a hidden cause, from MuJoCo: no code of the product's dynamics in it.

    case = generate('servicer', [('joint_viscous_friction', 'joint_2', {'coefficient': 3.0})],
                    folder=tmp_path, seed=3, bag=True)

`case.robot` is the robot file that a user would have, `case.data` the bag (or the `Record`), and
`case.hidden` what must be found: a test reads it after the verdict. Robots are `ROBOTS` of
`mujoco_robots.py` or a `TruthRobot` of one's own; effects are `EFFECTS` of `mujoco_plan.py`, one
or several, of one kind or many; excitations are `EXCITATIONS` of `mujoco_run.py`, or one's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spacerobot_ros.recording.record import Record

from .model import parse
from .plan import EFFECTS, Plan
from .robots import ROBOTS, TruthRobot, unit
from .run import EXCITATIONS, Excitation, History, Simulation, simulate
from .sensors import Noise, Sensors, sample, stream, to_record, write_bag

Hidden = Sequence[tuple[str, str | None, Mapping[str, Any]]]


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
    robot: str | TruthRobot,
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
        sensors: Rates and imperfections; by default those that `Sensors` states.
        bag: Write a rosbag2 folder rather than return a record.
    """
    what = ROBOTS[robot] if isinstance(robot, str) else robot
    motion = EXCITATIONS[excitation] if isinstance(excitation, str) else excitation
    sensors = sensors or Sensors(effort_std=what.effort_std)
    plan = planned(what, effects)
    errors = Noise(sensors, seed, len(plan.joints), duration, noise)
    history = simulate(
        plan,
        np.array(what.q0),
        unit(what.attitude_xyzw),
        np.array(what.omega),
        motion,
        duration,
        stream(seed, 20),
        _seen(plan, sensors, motion, errors),
    )
    held = motion.period_control if motion.control == 'held' else None
    samples = sample(plan, history, sensors, errors, held)
    record = to_record(plan, samples, sensors, seed, f'truth of seed {seed}')
    path = write_robot(what, sensors, folder)
    data = write_bag(record, folder / f'bag_{seed}', what.base_link) if bag else record
    return Case(path, data, effects, history)


def planned(robot: TruthRobot, effects: Hidden) -> Plan:
    """The plan of a robot with its hidden effects."""
    wheels = {robot.base_link: np.array(robot.servicer_wheels)} if robot.free else {}
    if robot.target_link:
        wheels[robot.target_link] = np.array(robot.target_wheels)
    plan = Plan(
        links=parse(robot.urdf),
        joints=list(robot.joints),
        base=robot.base_link,
        free=robot.free,
        gravity=np.array(robot.gravity),
        wheels=wheels,
    )
    for name, where, parameters in effects:
        EFFECTS[name](plan, where, **parameters)
    return plan


def write_robot(robot: TruthRobot, sensors: Sensors, folder: Path) -> Path:
    """Robot file and URDF."""
    stds = {
        'joint_position_std': sensors.position_std,
        'joint_velocity_std': sensors.velocity_std,
        'joint_effort_std': sensors.effort_std,
    }
    if robot.free:
        stds |= {'gyro_std': sensors.gyro_std, 'attitude_std': sensors.attitude_std}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'robot.urdf').write_text(robot.urdf, encoding='utf-8')
    path = folder / 'robot.yaml'
    path.write_text(robot.yaml('robot.urdf', stds), encoding='utf-8')
    return path


def believing(robot: str, target_wheels: tuple[float, float, float]) -> TruthRobot:
    """A robot whose file believes another momentum of the captured wheels."""
    return replace(ROBOTS[robot], target_wheels=target_wheels)


def _seen(plan: Plan, sensors: Sensors, motion: Excitation, errors: Noise) -> Any:
    """What a controller that reads the sensors is told: the very samples that are recorded."""
    past: list[tuple[np.ndarray, np.ndarray]] = []
    late = round(plan.delays.get('joints', 0.0) / motion.period_control)
    ratio = sensors.joint_rate * motion.period_control

    def seen(k: int, sim: Simulation) -> tuple[np.ndarray, np.ndarray]:
        past.append((sim.q.copy(), sim.qd.copy()))
        q, qd = past[max(k - late, 0)]
        told = {'position': q[None], 'velocity': qd[None], 'effort': np.zeros_like(q)[None]}
        told |= {'gyro': np.zeros((1, 3)), 'attitude': np.eye(3)[None]}
        for mend in plan.mends:
            mend(told)
        row = min(round(k * ratio), len(errors.of['position']) - 1)
        return (
            told['position'][0] + errors.of['position'][row],
            told['velocity'][0] + errors.of['velocity'][row],
        )

    return seen


__all__ = ['EFFECTS', 'EXCITATIONS', 'ROBOTS', 'Case', 'Excitation', 'Sensors', 'TruthRobot',
           'believing', 'generate', 'planned', 'write_robot']  # fmt: skip
