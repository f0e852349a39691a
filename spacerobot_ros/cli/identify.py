"""`spacerobot identify`: wheel momentum and inertial parameters from a recording.

Estimate the momentum of the captured satellite's wheels and the minimal inertial parameters from
a recording (rosbag2: mcap or sqlite3; an npz record; CSV or JSON, with --map). ROS is not needed.

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

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from ..display import Section, Table
from ..errors import IdentificationError
from .options import check_file
from .terminal import print_json, print_sections, progress

_MOST_ROWS = 60  # of a table; more than five joints have more minimal parameters

if TYPE_CHECKING:
    from ..identification.advice import Advice
    from ..identification.estimate import Estimate
    from ..model.robot import Robot
    from ..recording.record import Record


def run(args: argparse.Namespace) -> int:
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
    from ..sensing.sensor_faults import corrected_record

    if args.write:
        check_file(args.write, args.force)
    file = load_robot_file(args.robot)
    check_momentum(file.robot)  # before the recording, which may lack what only that needs
    record = _read(args, file.robot)
    if file.robot.joints:
        record = corrected_record(record, file.robot, file.effects)
    robot, settings = file.believed, file.settings.identifier
    if file.robot.joints:
        with progress() as stage:
            advance = stage('identifying, passes', MOST_PASSES)
            result = identify(record, robot, settings, args.method, advance)
        minimal = minimal_set(robot, settings.structure)
        groups = list(standard_parameters(robot, minimal, settings.structure))
        advice = []
        if result.model is not None and result.posterior is not None:
            advice = list(advise_on(record, result.model, result.posterior, file.settings))
    else:
        result = identify_lone_body(record, file.robot, file.effects)
        groups, advice = [robot.base_link] * len(result.estimate.parameters), []
    estimate = result.estimate
    if args.json:
        data = {'schema': 1, **estimate.to_dict()}
        for parameter, group in zip(data['parameters'], groups, strict=True):
            parameter['groups'] = group
        data['advice'] = [asdict(one) for one in advice]
        print_json(data)
    else:
        print_sections(_sections(estimate, groups, advice))
    if args.write:
        if result.robot is None:
            raise IdentificationError(f'{args.write} is not written: `ls` finds no bodies')
        write_robot_file(file.before_effects(result.robot), args.robot, args.write)
    return 0 if estimate.valid else 1


def _read(args: argparse.Namespace, robot: Robot) -> Record:
    """The recording, or the longest of the stretches between its pauses."""
    from ..recording.read import read_record, read_records

    if not args.split_gaps:
        return read_record(args.bag, robot, args.map)
    stretches = read_records([args.bag], robot, args.map, split_gaps=True)
    longest = max(stretches, key=lambda part: part.span[1] - part.span[0])
    note = f'the longest of {len(stretches)} stretches between pauses; the others are not used'
    return replace(longest, notes=(*longest.notes, note)) if len(stretches) > 1 else longest


def _sections(
    estimate: Estimate, groups: Sequence[str], advice: Sequence[Advice]
) -> Iterator[Section]:
    """What is printed for people."""
    n, std = len(estimate.aam), estimate.std
    sources = estimate.sources or ('data',) * len(std)
    momentum_std = estimate.total_momentum_covariance.diagonal() ** 0.5
    momenta = [f'h_{link}_{axis}' for link in estimate.aam_links for axis in 'xyz']
    if momenta:
        units = ['N m s'] * n
        wheels = zip(momenta, estimate.aam, std[:n], units, sources[:n], strict=True)
        yield _estimates('wheel momentum of the captured body', wheels)
    if any(estimate.units):
        total = zip('xyz', estimate.total_momentum, momentum_std, ['N m s'] * 3, strict=True)
        yield _estimates('total angular momentum, inertial frame', total)
    title = 'minimal inertial parameters, each with the numbers of the bodies that it groups'
    names, values = estimate.parameter_names, estimate.parameters
    found = zip(names, values, std[n:], estimate.units, sources[n:], groups, strict=True)
    if len(names) <= _MOST_ROWS:
        yield _estimates(title, found)
    else:
        yield Section('', [f'{len(names)} minimal inertial parameters: --json has them'])
    head = (
        f'method {estimate.method}, {estimate.samples} samples, rank {estimate.rank} of '
        f'{estimate.unknowns}, condition {estimate.condition:.4g}, '
        f'chi-square per degree of freedom {estimate.chi2_per_dof:.3g}'
    )
    only = [f'from the file alone: {line}' for line in estimate.unexcited]
    reason = [] if estimate.valid else [f'not valid: {estimate.reason}']
    notes = [f'note: {note}' for note in estimate.notes]
    yield Section('', [head, *only, *notes, *reason])
    if advice:
        rows = [(one.motion or 'none of those tried', '\n'.join(one.tells)) for one in advice]
        title = 'what more motion would tell of the wheel momentum, in the order of its worth'
        yield Section(title, [Table(('extra motion', 'tells'), rows)])


def _estimates(title: str, rows: Iterable[tuple[Any, ...]]) -> Section:
    """Names, values as far as they are known, their standard deviations, units and sources."""
    from ..formats import decimals

    head = ('name', 'value', '+- std', 'unit', 'from', 'groups')
    cells = [
        (name, f'{value:.{decimals(std)}f}', f'{std:.{decimals(std)}f}', *others)
        for name, value, std, *others in rows
    ]
    return Section(title, [Table(head[: len(cells[0])] if cells else head[:4], cells)])
