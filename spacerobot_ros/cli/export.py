"""`spacerobot export`: a model for other simulators, and what is lost on the way.

Write a robot file, such as the extended model of a diagnosis, for other simulators, and say what
their format can not.

formats: mjcf  MuJoCo: bodies, armature, damping, frictionloss, springs, gains and limits of the
               motors, noise and delays of the sensors, wheels as balls that spin
         urdf  bodies, damping and friction of the joints

examples:
  spacerobot export --robot out/diagnosis/extended_model.yaml --to mjcf -o out/model.xml
  spacerobot export --robot config/servicer.yaml --to urdf -o out/model.urdf

exit status: 0 written, 2 unusable input
"""

from __future__ import annotations

import argparse

from ..display import Section
from ..formats import counted
from .options import check_file
from .terminal import print_json, print_sections


def run(args: argparse.Namespace) -> int:
    """Write, and say what is lost."""
    from ..effects.robot_file import load_robot_file
    from ..model.files import write_text
    from ..simulation.export.mjcf import to_mjcf
    from ..simulation.export.plain_urdf import to_urdf

    target = check_file(args.output, args.force, args.robot)
    file = load_robot_file(args.robot)
    exported = to_mjcf(file) if args.to == 'mjcf' else to_urdf(file)
    write_text(target, exported.text)
    if args.json:
        print_json(
            {
                'schema': 1,
                'format': args.to,
                'written': args.output,
                'effects_written': exported.included,
                'lost': exported.lost,
            }
        )
        return 0
    count = f'{counted(len(exported.included), "effect")} written'
    count += f', {counted(len(exported.lost), "thing")} lost'
    lines = [f'written: {args.output}: {count}', *(f'lost: {one}' for one in exported.lost)]
    print_sections([Section('', lines)])
    return 0
