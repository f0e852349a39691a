"""Onboard estimation and control of a free-floating space robot with spinning wheels on board.

The names below are the Python surface; where they are defined may change. Each is imported when it
is first asked for.

    import spacerobot_ros as sr

    file = sr.load_robot_file('config/servicer.yaml')
    record = sr.read_record('bag', file.robot)
    print(sr.identify(record, file.believed, file.settings.identifier).estimate.aam)
    found = sr.diagnose(record, file.robot, file.effects)
    print(found.verdict, found.sentence)
    sr.write_extended_model('config/servicer.yaml', [c.applied for c in found.causes], 'new.yaml')
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .diagnosis.answer.extended_model import write_extended_model as write_extended_model
    from .diagnosis.answer.result import Diagnosis as Diagnosis
    from .diagnosis.comparison.change_conclusion import Comparison as Comparison
    from .diagnosis.comparison.compare import compare as compare
    from .diagnosis.diagnose import diagnose as diagnose
    from .diagnosis.flight.monitor import Monitor as Monitor
    from .diagnosis.quality.quality import check_record as check_record
    from .dynamics.state import State as State
    from .effects.catalogue import CATALOGUE as CATALOGUE
    from .effects.catalogue import bind_effect as bind_effect
    from .effects.effect import Effect as Effect
    from .effects.joint import JointTorque as JointTorque
    from .effects.motion import Motion as Motion
    from .effects.parameter import Parameter as Parameter
    from .effects.robot_file import RobotFile as RobotFile
    from .effects.robot_file import load_robot_file as load_robot_file
    from .errors import ConfigurationError as ConfigurationError
    from .errors import RecordingError as RecordingError
    from .errors import SpaceRobotError as SpaceRobotError
    from .excitation.assessment import design_motion as design_motion
    from .excitation.motions import write_trajectory as write_trajectory
    from .identification.batch import identify as identify
    from .recording.npz import save_npz as save_npz
    from .recording.read import read_record as read_record
    from .recording.record import Record as Record
    from .simulation.closed_loop import ClosedLoop as ClosedLoop
    from .simulation.closed_loop import record_run as record_run
    from .simulation.export.mjcf import to_mjcf as to_mjcf
    from .simulation.export.plain_urdf import to_urdf as to_urdf
    from .simulation.plant import Plant as Plant

# The matrices here are small: a second BLAS thread costs more than it gives, and takes the core
# from the other nodes. Read by OpenBLAS when numpy is imported.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

__version__ = '0.2.0'

PUBLIC = {
    'load_robot_file': 'effects.robot_file',
    'RobotFile': 'effects.robot_file',
    'read_record': 'recording.read',
    'Record': 'recording.record',
    'save_npz': 'recording.npz',
    'check_record': 'diagnosis.quality.quality',
    'identify': 'identification.batch',
    'diagnose': 'diagnosis.diagnose',
    'Diagnosis': 'diagnosis.answer.result',
    'write_extended_model': 'diagnosis.answer.extended_model',
    'compare': 'diagnosis.comparison.compare',
    'Comparison': 'diagnosis.comparison.change_conclusion',
    'design_motion': 'excitation.assessment',
    'write_trajectory': 'excitation.motions',
    'ClosedLoop': 'simulation.closed_loop',
    'record_run': 'simulation.closed_loop',
    'Plant': 'simulation.plant',
    'State': 'dynamics.state',
    'Monitor': 'diagnosis.flight.monitor',
    'CATALOGUE': 'effects.catalogue',
    'bind_effect': 'effects.catalogue',
    'Effect': 'effects.effect',
    'JointTorque': 'effects.joint',
    'Parameter': 'effects.parameter',
    'Motion': 'effects.motion',
    'to_mjcf': 'simulation.export.mjcf',
    'to_urdf': 'simulation.export.plain_urdf',
    'SpaceRobotError': 'errors',
    'ConfigurationError': 'errors',
    'RecordingError': 'errors',
}
"""Where each public name is defined, as the imports above say to type checkers."""


def __getattr__(name: str) -> object:
    """A public name, imported now (PEP 562)."""
    if name not in PUBLIC:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = value = getattr(import_module(f'.{PUBLIC[name]}', __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})
