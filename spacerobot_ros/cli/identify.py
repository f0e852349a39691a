"""`spacerobot identify`: estimate wheel momentum and inertial parameters from a recording

Estimate the momentum of the captured satellite's wheels and the minimal inertial parameters from
a recording (rosbag2: mcap or sqlite3; an npz record; CSV or JSON, with --map). ROS is not needed.

DATA is a rosbag2 folder, mcap or db3 file, npz, CSV or JSON (.gz).

methods: ml        maximum likelihood over the bodies, with the robot file's uncertainty of them as
                   prior (robot.uncertainty); the most accurate, joints may turn or slide
         recursive the same as the identifier node does it, sample by sample
         ls        the paper's least squares, without a prior: for reproduction, joints that turn

Each number says what it is from: data, file (the motion does not tell it), or both.

examples:
  spacerobot identify run --robot config/servicer.yaml
  spacerobot identify run --robot config/servicer.yaml --json | jq .aam
  spacerobot identify run --robot config/servicer.yaml --write out/identified.yaml

exit status: 0 valid estimate, 1 the data do not suffice (the reason is given), 2 unusable input
"""

from __future__ import annotations

from dataclasses import replace

from ..errors import IdentificationError
from . import options as opt
from .terminal import print_answer, progress


@opt.command(__doc__)
@opt.path_argument('bag', metavar='DATA')
@opt.recording
@opt.robot
@opt.choice('--method', ('ml', 'recursive', 'ls'), default='ml', help='estimator')
@opt.path('--write', metavar='YAML', help='write the robot with the bodies found, YAML and URDF')
@opt.switch('--force', help='overwrite what --write names')
@opt.force_data
@opt.as_json
def run(
    bag: str, mapping: str | None, split_gaps: bool, robot: str, method: str, write: str | None,
    force: bool, force_data: bool, as_json: bool,
) -> int:  # fmt: skip
    """Identify and print; 0 for a valid estimate, 1 where the data do not suffice."""
    from ..dynamics.blocks import check_momentum
    from ..effects.robot_file import load_robot_file
    from ..estimation.unknowns.minimal import minimal_set
    from ..estimation.unknowns.standard_parameters import standard_parameters
    from ..identification.advice import advise_on
    from ..identification.batch import identify
    from ..identification.lone_body import identify_lone_body
    from ..identification.validity_limits import MOST_PASSES
    from ..model.writer import write_robot_file
    from ..recording.faults.data_faults import check_data, with_known_faults
    from ..recording.read import read_record, read_records
    from ..report.estimate_tables import estimate_sections
    from ..sensing.sensor_faults import corrected_record

    if write:
        opt.check_file(write, force)
    file = load_robot_file(robot)
    check_momentum(file.robot)  # before the recording, which may lack what only that needs
    stretches = (
        read_records([bag], file.robot, mapping, split_gaps=True)
        if split_gaps
        else (read_record(bag, file.robot, mapping),)
    )
    record = max(stretches, key=lambda part: part.span[1] - part.span[0])
    if len(stretches) > 1:
        note = f'the longest of {len(stretches)} stretches between pauses; the others are not used'
        record = replace(record, notes=(*record.notes, note))
    if force_data:
        record = with_known_faults(record, file.robot)
    check_data(record, file.robot)
    if file.robot.joints:
        record = corrected_record(record, file.robot, file.effects)
    machine, settings = file.believed, file.settings.identifier
    if file.robot.joints:
        with progress() as stage:
            advance = stage('identifying, passes', MOST_PASSES)
            result = identify(record, machine, settings, method, advance)
        minimal = minimal_set(machine, settings.structure)
        groups = list(standard_parameters(machine, minimal, settings.structure))
        advice = list(advise_on(record, result, file.settings))
    else:
        result = identify_lone_body(record, file.robot, file.effects)
        groups, advice = [machine.base_link] * len(result.estimate.parameters), []
    estimate = result.estimate
    values = {'schema': 1, **estimate.to_dict(), 'advice': advice}
    for parameter, group in zip(values['parameters'], groups, strict=True):
        parameter['groups'] = group
    print_answer(as_json, values, estimate_sections(estimate, groups, advice))
    if write:
        if result.robot is None:
            raise IdentificationError(f'{write} is not written: `ls` finds no bodies')
        write_robot_file(file.before_effects(result.robot), robot, write)
    return 0 if estimate.valid else 1
