"""`spacerobot show`: play a recording in 3D on one page, with what the model makes of it

Write one page that plays a recording in 3D: bodies from the URDF's visuals or from their inertia,
base attitude, joints, wheel and total momentum as arrows; beneath it the channels. A ghost shows
what the model makes of the measured efforts, beginning again from the measured state every two
seconds. The page needs no network; meshes are read from STL, OBJ and DAE (with the extra
`meshes`). ROS is not needed.

DATA is a rosbag2 folder, mcap or db3 file, npz, CSV or JSON (.gz).

examples:
  spacerobot show run --robot config/servicer.yaml -o out/replay.html
  spacerobot show run --robot out/diagnosis/extended_model.yaml -o out/extended.html

exit status: 0 written, 2 unusable input
"""

from __future__ import annotations

from pathlib import Path

from ..formats import counted
from . import options as opt


@opt.command(__doc__)
@opt.path_argument('data', metavar='DATA')
@opt.robot
@opt.path('-o', '--output', metavar='HTML', required=True, help='page to write')
@opt.mapping
@opt.switch('--no-prediction', help="leave the model's ghost out")
@opt.switch('--force', help='replace a page that is there')
def run(
    data: str, robot: str, output: str, mapping: str | None, no_prediction: bool, force: bool
) -> int:
    """Write the page."""
    from ..display import Replay, Report, Section
    from ..effects.robot_file import load_robot_file
    from ..recording.read import read_record
    from ..report.html import write_report
    from ..simulation.replay.scene import scene_of

    target = opt.check_file(output, force, robot)
    file = load_robot_file(robot)
    record = read_record(data, file.robot, mapping)
    scene = scene_of(record, file, has_prediction=not no_prediction)
    caption = 'Drag to turn, wheel or pinch to zoom; click into a channel to go to that time.'
    if scene.predicted is not None:
        caption += ' The orange ghost is what the model makes of the measured efforts.'
    section = Section('', [Replay(scene, caption)])
    title = f'{file.robot.name}: {Path(data).name}'
    write_report(Report(title, record.source, [section]), target)
    length = scene.measured.time[-1] - scene.measured.time[0]
    print(f'written: {target}: {length:.3g} s in {counted(len(scene.measured.time), "picture")}')
    for note in scene.notes:
        print(f'note: {note}')
    return 0
