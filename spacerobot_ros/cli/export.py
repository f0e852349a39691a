"""`spacerobot export`: write a model for MuJoCo or as plain URDF, and say what is lost

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

from ..display import Section
from ..formats import counted
from . import options as opt
from .terminal import print_answer


@opt.command(__doc__)
@opt.robot
@opt.choice('--to', ('mjcf', 'urdf'), required=True, help='format')
@opt.path('-o', '--output', metavar='FILE', required=True, help='file to write')
@opt.switch('--force', help='replace a file that is there')
@opt.as_json
def run(robot: str, to: str, output: str, force: bool, as_json: bool) -> int:
    """Write, and say what is lost."""
    from ..effects.robot_file import load_robot_file
    from ..model.files import write_text
    from ..simulation.export.mjcf import to_mjcf
    from ..simulation.export.plain_urdf import to_urdf

    target = opt.check_file(output, force, robot)
    file = load_robot_file(robot)
    exported = to_mjcf(file) if to == 'mjcf' else to_urdf(file)
    write_text(target, exported.text)
    included, lost = exported.included, exported.lost
    values = {'schema': 1, 'format': to, 'written': output, 'effects_written': included}
    count = f'{counted(len(included), "effect")} written, {counted(len(lost), "thing")} lost'
    lines = [f'written: {output}: {count}', *(f'lost: {one}' for one in lost)]
    print_answer(as_json, {**values, 'lost': lost}, [Section('', lines)])
    return 0
