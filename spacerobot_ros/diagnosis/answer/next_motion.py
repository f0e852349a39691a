"""What to fly next: for every rival, the command that designs the motion which tells it apart."""

from __future__ import annotations

import shlex
from dataclasses import replace

from .cause import Cause
from .result import Diagnosis


def with_motions(diagnosis: Diagnosis, robot_file: str) -> Diagnosis:
    """The diagnosis with a motion for each rival and a list of what to fly next.

    Args:
        diagnosis: The answer.
        robot_file: Path of the robot file, for the commands.
    """
    causes = tuple(_with_motions(cause, robot_file) for cause in diagnosis.causes)
    return replace(diagnosis, causes=causes, next_motion=_advice(diagnosis, causes, robot_file))


def effect_at(effect: str, where: str | None) -> str:
    """An effect and its place as the command line names them."""
    return effect if where is None else f'{effect}@{where}'


def _with_motions(cause: Cause, robot_file: str) -> Cause:
    own = effect_at(*cause.applied.key)
    rivals = (
        replace(rival, motion=_separating(own, effect_at(*rival.key), robot_file))
        for rival in cause.rivals
    )
    return replace(cause, rivals=tuple(rivals))


def _separating(own: str, other: str, robot_file: str) -> str:
    words = ['spacerobot', 'excite', '--robot', robot_file, '--separate', own, other]
    return shlex.join([*words, '-o', 'separate.yaml'])


def _advice(diagnosis: Diagnosis, causes: tuple[Cause, ...], robot_file: str) -> tuple[str, ...]:
    """What would say more, most useful first."""
    lines = [
        f'To tell {effect_at(*cause.applied.key)} from '
        f'{effect_at(*rival.key)}, fly the motion that this designs: {rival.motion}'
        for cause in causes
        for rival in cause.rivals
    ]
    lines += [
        f'{place} moves at one speed only: friction that grows with the rate and friction that '
        'does not are one there. The motion that tells them apart: '
        + _separating(
            f'joint_viscous_friction@{place}', f'joint_coulomb_friction@{place}', robot_file
        )
        for entry in diagnosis.leftover or ()
        if entry.one_speed and (place := entry.channel.partition('/')[2])
    ]
    if diagnosis.verdict in ('unexplained', 'partly_explained'):
        lines += [
            'Fly the same motion at half and at twice the speed: what grows with the rate is '
            'friction or a delay, what grows with its square is inertia, what stays comes from '
            'outside or from a sensor.',
            'Record a minute with resting joints: what is left then does not come from the arm.',
        ]
    elif diagnosis.verdict == 'explained' and not lines:
        lines.append(
            'Fly another motion and diagnose it with extended_model.yaml: it should be consistent.'
        )
    return tuple(lines)
