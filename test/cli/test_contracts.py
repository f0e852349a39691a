"""Schemas of what is printed as JSON, and completion in shells."""

from __future__ import annotations

import argparse
import subprocess
from importlib import resources

import jsonschema
import pytest
from support.contracts import schema_of

from spacerobot_ros.cli import main

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


def test_every_command_that_prints_json_has_a_schema():
    subparsers = next(
        a for a in main.whole_parser()._actions if isinstance(a, argparse._SubParsersAction)
    )
    prints = [
        name for name, parser in subparsers.choices.items() if '--json' in parser.format_usage()
    ]
    assert set(prints) <= set(NAMES)
    assert len(prints) >= 6


def complete(script, *words):
    """What bash offers for the last word."""
    line = ' '.join(f'"{word}"' for word in words)
    ask = f'source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _shtab_spacerobot'
    done = subprocess.run(
        ['bash', '-c', f'{ask}; echo "${{COMPREPLY[@]}}"'],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_bash_completes_commands_options_choices_and_files(tmp_path, monkeypatch, capsys):
    assert main.main(['completion', 'bash']) == 0
    script = tmp_path / 'script'
    script.write_text(capsys.readouterr().out)
    (tmp_path / 'servicer.yaml').touch()
    monkeypatch.chdir(tmp_path)
    assert complete(script, 'spacerobot', 'dia') == ['diagnose']
    assert complete(script, 'spacerobot', 'identify', '--met') == ['--method']
    assert complete(script, 'spacerobot', 'identify', '--method', '') == ['ml', 'recursive', 'ls']
    assert complete(script, 'spacerobot', 'identify', '--robot', 'ser') == ['servicer.yaml']


def test_zsh_has_a_script(capsys):
    assert main.main(['completion', 'zsh']) == 0
    script = capsys.readouterr().out
    assert script.startswith('#compdef spacerobot')
    assert '--separate' in script
