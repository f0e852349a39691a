"""Schemas of what is printed as JSON, and completion in shells."""

from __future__ import annotations

import importlib
import inspect
import os
import subprocess
import sys
from importlib import resources
from pathlib import Path

import jsonschema
import pytest
from support.contracts import schema_of

from spacerobot_ros.cli import main
from spacerobot_ros.cli.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
FILES = 'files'  # what stands for readline's own completion

NAMES = sorted(
    path.name.removesuffix('.json')
    for path in (resources.files('spacerobot_ros') / 'schemas').iterdir()
)


@pytest.mark.parametrize('name', NAMES)
def test_every_schema_is_one_and_says_its_version(name):
    schema = schema_of(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    version = schema['properties']['schema']['const']
    assert schema['$id'] == f'urn:spacerobot:{name}:{version}'


PARSED = {name: importlib.import_module(f'spacerobot_ros.cli.{name}').run for name in COMMANDS}


def test_every_command_that_prints_json_has_a_schema():
    prints = [name for name, run in PARSED.items() if any('--json' in p.opts for p in run.params)]
    assert set(prints) <= set(NAMES)
    assert len(prints) >= 6


@pytest.mark.parametrize('name', COMMANDS)
def test_a_command_takes_what_is_parsed_for_it(name):
    taken = inspect.signature(PARSED[name].callback).parameters.values()
    parsed = {param.name for param in PARSED[name].params}
    named = {p.name for p in taken if p.kind is not p.VAR_KEYWORD} - {'context'}
    assert named <= parsed
    assert named == parsed or any(p.kind is p.VAR_KEYWORD for p in taken)


@pytest.fixture
def in_bash(tmp_path, monkeypatch):
    """Have bash complete a line; `compopt`, which asks readline for files, says so."""
    (tmp_path / 'spacerobot').write_text(
        f'#!/bin/sh\nexec {sys.executable} -m spacerobot_ros.cli.main "$@"\n'
    )
    (tmp_path / 'spacerobot').chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}:{os.environ["PATH"]}')
    monkeypatch.setenv('PYTHONPATH', str(ROOT))

    def complete(*words):
        line = ' '.join(f'"{word}"' for word in words)
        ask = (
            f'compopt() {{ echo "{FILES}"; }}; source <(spacerobot completion bash); '
            f'COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _spacerobot_completion spacerobot;'
            ' echo "${COMPREPLY[@]}"'
        )
        done = subprocess.run(['bash', '-c', ask], capture_output=True, text=True, check=True)
        return done.stdout.split()

    return complete


def test_bash_completes_commands_options_choices_and_files(in_bash):
    assert in_bash('spacerobot', 'dia') == ['diagnose']
    assert in_bash('spacerobot', 'identify', '--met') == ['--method']
    methods = in_bash('spacerobot', 'identify', '--method', '')
    assert methods == ['ml', 'recursive', 'ls']
    assert in_bash('spacerobot', 'identify', '--robot', 'ser') == [FILES]
    assert in_bash('spacerobot', 'identify', 'ru') == [FILES]


def test_zsh_has_a_script_and_is_answered(capsys, monkeypatch):
    assert main.main(['completion', 'zsh']) == 0
    assert capsys.readouterr().out.startswith('#compdef spacerobot')
    monkeypatch.setenv('_SPACEROBOT_COMPLETE', 'zsh_complete')
    monkeypatch.setenv('COMP_WORDS', 'spacerobot excite --sep')
    monkeypatch.setenv('COMP_CWORD', '2')
    assert main.main([]) == 0
    kind, name, text = capsys.readouterr().out.splitlines()
    assert (kind, name) == ('plain', '--separate')
    assert 'tells two effects' in text
