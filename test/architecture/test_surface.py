"""The Python surface: what `import spacerobot_ros` offers, and that nothing else is promised."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import spacerobot_ros

ROOT = Path(__file__).parents[2]
HEAVY = ('numpy', 'scipy', 'numba', 'yaml', 'rosbags', 'pinocchio', 'rclpy', 'rich')
SURFACE = {  # name: its parameters, with ? where one has a default
    'write_extended_model': 'template causes path',
    'Diagnosis': (
        'verdict sentence causes? minor? residuals? series? gain? ranking? fit_p? null_p? '
        'next_motion? notes? calibration? recordings? friction? leftover? orders? ratios? '
        'free_motion? events? covariance? method?'
    ),
    'Comparison': (
        'verdict sentence changes detectable left unjudged unidentified notes units is_repeated '
        'series'
    ),
    'compare': 'before after robot believed? report?',
    'diagnose': 'records robot believed? catalogue? report? loaded?',
    'Monitor': 'robot settings believed? momentum_std?',
    'check_record': 'record file?',
    'State': 'p_WB q_WB_xyzw q v_WB_B omega_WB_B qd',
    'CATALOGUE': 'mappingproxy',
    'bind_effect': 'name effect_id where values robot changed?',
    'Effect': 'name where values recordings?',
    'JointTorque': 'name where values recordings?',
    'Motion': (
        'robot time q qd effort rotation? omega? velocity? acceleration? unpowered? '
        'coasts? window?'
    ),
    'Parameter': (
        'name unit size? relevant? minimum? above? maximum? nominal? default? role? '
        'guesses? beyond?'
    ),
    'RobotFile': 'robot settings effects? folder?',
    'load_robot_file': 'path',
    'ConfigurationError': 'PlacedError',
    'RecordingError': 'PlacedError',
    'SpaceRobotError': 'Exception',
    'design_motion': 'file progress?',
    'write_trajectory': 'chosen template path',
    'identify': 'record robot settings method? on_pass?',
    'read_record': 'path robot map_path? topics? is_joined?',
    'save_npz': 'record path',
    'Record': 'joints? rates? attitudes? wheels? source? notes? zero_ns? inputs? description? '
    'faults_are_known?',
    'ClosedLoop': 'robot settings estimate?',
    'record_run': 'loop steps path overwrite? progress?',
    'to_mjcf': 'file',
    'to_urdf': 'file',
    'Plant': 'robot initial period substeps effects? tableau?',
}


def test_the_surface_is_pinned():
    offered = {name: getattr(spacerobot_ros, name) for name in spacerobot_ros.PUBLIC}
    assert {name: said(value) for name, value in offered.items()} == SURFACE


def said(value):
    """Parameters by name, those with a default marked; of the catalogue its type."""
    if not callable(value):
        return type(value).__name__
    if inspect.isclass(value) and issubclass(value, Exception):
        return value.__bases__[0].__name__
    parameters = inspect.signature(value).parameters.values()
    return ' '.join(p.name + '?' * (p.default is not p.empty) for p in parameters)


def test_type_checkers_are_told_the_same_places():
    tree = ast.parse((ROOT / 'spacerobot_ros' / '__init__.py').read_text(encoding='utf-8'))
    (guarded,) = (node for node in tree.body if isinstance(node, ast.If))
    told = {node.names[0].name: node.module for node in guarded.body}
    assert told == spacerobot_ros.PUBLIC
    assert all(node.names[0].asname == node.names[0].name for node in guarded.body)


def test_names_are_listed_and_others_refused():
    assert set(SURFACE) < set(dir(spacerobot_ros))
    with pytest.raises(AttributeError, match="'spacerobot_ros' has no attribute 'diagnoze'"):
        spacerobot_ros.diagnoze  # noqa: B018


def test_the_import_alone_loads_nothing():
    code = (
        'import sys; before = set(sys.modules); import spacerobot_ros;'
        'print(*(set(sys.modules) - before - {"spacerobot_ros"}))'
    )
    done = subprocess.run(
        [sys.executable, '-S', '-c', code],
        capture_output=True, text=True, check=True, cwd=ROOT, env={},
    )  # fmt: skip
    loaded = done.stdout.split()
    assert not [name for name in loaded if name.startswith('spacerobot_ros.')]
    assert not set(loaded) & set(HEAVY)


def test_pages_use_this_surface_alone():
    pages = [*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md')]
    texts = [(p, p.read_text(encoding='utf-8')) for p in pages if p.name != 'CHANGELOG.md']
    inner = r'^ *(?:from|import) spacerobot_ros\.[\w.]+'
    assert not [(p.name, line) for p, text in texts for line in re.findall(inner, text, re.M)]
    names = r'^ *from spacerobot_ros import (.+)$'
    used = {
        n for _, text in texts for line in re.findall(names, text, re.M) for n in line.split(', ')
    }
    assert used
    assert used <= set(SURFACE)
