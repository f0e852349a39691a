"""What every engine's script shares: timing, and one JSON line a setting."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import servicer

# CPU seconds of the process: on a machine with other work the wall clock measures the neighbours.
clock = time.process_time
REPEATS = int(os.environ.get('BENCH_REPEATS', '3'))


@dataclass
class Outcome:
    """One run of 20 s.

    Args:
        seconds: CPU time of the integration alone.
        momenta: Angular momentum (inertial frame) once a second, its start first [N m s].
        attitude_xyzw: At the end.
        arm: (3,) joint positions at the end [rad].
    """

    seconds: float
    momenta: list
    attitude_xyzw: object
    arm: object


Setting = tuple[str, str, Callable[[], Outcome]]
"""Scenario, name of integrator and step, and the run."""


def report(engine: str, version: str, settings: Iterable[Setting]) -> None:
    """Run every setting a few times and print the fastest as a JSON line."""
    for scenario, name, run in settings:
        run()  # compiles, and fills caches
        best = min((run() for _ in range(REPEATS)), key=lambda outcome: outcome.seconds)
        h = np.array(best.momenta, dtype=float)
        drift = np.max(np.linalg.norm(h - h[0], axis=1)) / np.linalg.norm(h[0])
        line = {
            'engine': engine,
            'version': version,
            'scenario': scenario,
            'setting': name,
            'seconds': best.seconds,
            'momentum_drift': float(drift),
            'attitude_xyzw': np.asarray(best.attitude_xyzw, dtype=float).tolist(),
            'arm': np.asarray(best.arm, dtype=float).tolist(),
        }
        print(json.dumps(line), flush=True)


def run_seconds(advance: Callable[[int], None], state: Callable[[], tuple]) -> Outcome:
    """Advance an engine second by second, the integration timed and the momentum not.

    Args:
        advance: Takes the number of the second, 0 to 19, and integrates it.
        state: Rotation, omega and velocity of the base (inertial frame), q, qd, attitude xyzw.
    """
    momenta, seconds = [servicer.momentum(*state()[:5])], 0.0
    for second in range(round(servicer.DURATION)):
        start = clock()
        advance(second)
        seconds += clock() - start
        momenta.append(servicer.momentum(*state()[:5]))
    *_, q, _, attitude = state()
    return Outcome(seconds, momenta, attitude, q[:3])


def held_torques() -> list[tuple[float, float, float]]:
    """Torques of the held run, one a control period [N m]."""
    count = round(servicer.DURATION / servicer.PERIOD)
    return [servicer.torque(k * servicer.PERIOD) for k in range(count)]


def rk4(machine: Any, scenario: str, step: float) -> Outcome:
    """Classical Runge-Kutta over an engine that has no simulator of its own.

    Args:
        machine: `x`, its state, `rate(x, torques)`, and `state` as `run_seconds` asks for.
        scenario: smooth or held.
        step: Step [s]; divides a second and, held, the control period.
    """
    count, rate = round(1.0 / step), machine.rate
    torques, period = held_torques(), max(1, round(servicer.PERIOD / step))

    def drive(k: int) -> tuple:
        if scenario == 'held':
            return (torques[k // period],) * 3
        return tuple(servicer.torque((k + part) * step) for part in (0.0, 0.5, 1.0))

    def advance(second: int) -> None:
        x = machine.x
        for k in range(second * count, (second + 1) * count):
            first, middle, last = drive(k)
            k1 = rate(x, first)
            k2 = rate(x + 0.5 * step * k1, middle)
            k3 = rate(x + 0.5 * step * k2, middle)
            k4 = rate(x + step * k3, last)
            x = x + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        machine.x = x

    return run_seconds(advance, machine.state)


def by_step(
    run: Callable[[str, float], Outcome], steps: Sequence[float], scheme: str = 'RK4'
) -> list[Setting]:
    """Settings of both scenarios from coarse to fine; held torques need whole steps a period."""
    return [
        (scenario, f'{scheme} {1e3 * h:g} ms', lambda s=scenario, h=h: run(s, h))
        for scenario in servicer.SCENARIOS
        for h in steps
        if scenario == 'smooth' or h <= servicer.PERIOD
    ]


def stepped(machine: Any, scenario: str, state: Callable[[], tuple]) -> Outcome:
    """An engine with a simulator of its own.

    Args:
        machine: `run_to(t)`, and `hold(torques)` from now on, for every control period of `held`.
        scenario: smooth or held.
        state: As `run_seconds` asks for.
    """
    torques, periods = held_torques(), round(1.0 / servicer.PERIOD)

    def advance(second: int) -> None:
        if scenario == 'smooth':
            machine.run_to(second + 1.0)
            return
        for k in range(second * periods, (second + 1) * periods):
            machine.hold(torques[k])
            machine.run_to((k + 1) * servicer.PERIOD)

    return run_seconds(advance, state)


def start_vector() -> np.ndarray:
    """Position, quaternion, joints, twist in the base's frame, rates, at the start."""
    zeros = np.zeros(len(servicer.JOINTS))
    parts = (np.zeros(3), servicer.ATTITUDE_XYZW, zeros, np.zeros(3), servicer.OMEGA_B)
    return np.concatenate([*parts, servicer.RATES])
