"""`spacerobot show`: a recording in 3D, on one page.

Write one page that plays a recording in 3D: bodies from the URDF's visuals or from their inertia,
base attitude, joints, wheel and total momentum as arrows; beneath it the channels. A ghost shows
what the model makes of the measured efforts, beginning again from the measured state every two
seconds. The page needs no network; meshes are read from STL, OBJ and DAE (with the extra
`meshes`). ROS is not needed.

examples:
  spacerobot show run --robot config/servicer.yaml -o out/replay.html
  spacerobot show run --robot out/diagnosis/extended_model.yaml -o out/extended.html

exit status: 0 written, 2 unusable input
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ..formats import counted
from .options import check_file


def run(args: argparse.Namespace) -> int:
    """Write the page."""
    from ..display import Replay, Report, Section
    from ..effects.robot_file import load_robot_file
    from ..recording.read import read_record
    from ..report.html import write_report
    from ..simulation.replay.scene import scene_of

    target = check_file(args.output, args.force, args.robot)
    file = load_robot_file(args.robot)
    record = read_record(args.data, file.robot, args.map)
    scene = scene_of(record, file, has_prediction=not args.no_prediction)
    caption = 'Drag to turn, wheel or pinch to zoom; click into a channel to go to that time.'
    if scene.predicted is not None:
        caption += ' The orange ghost is what the model makes of the measured efforts.'
    section = Section('', [Replay(scene, caption)])
    title = f'{file.robot.name}: {Path(args.data).name}'
    write_report(Report(title, record.source, [section]), target)
    length = scene.measured.time[-1] - scene.measured.time[0]
    print(f'written: {target}: {length:.3g} s in {counted(len(scene.measured.time), "picture")}')
    for note in scene.notes:
        print(f'note: {note}')
    return 0
