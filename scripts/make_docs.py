"""Lay out the pages of the documentation site, what is generated among them, for `mkdocs build`.

The tree is the repository's own, so that links hold as they stand. Commands are documented by
their `--help`, effects by the catalogue, the Python surface by docstrings.

    python scripts/make_docs.py [FOLDER]      # out/docs: pages, and mkdocs.yml
"""

from __future__ import annotations

import importlib
import inspect
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
_COPIED = ('README.md', 'CHANGELOG.md', 'CONTRIBUTING.md', 'LICENSE')
_SUFFIXES = ('.md', '.svg', '.png', '.js')
_WIDTH = '96'  # columns of the help


def main() -> int:
    """Write the pages."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'out' / 'docs'
    pages = out / 'pages'
    shutil.rmtree(out, ignore_errors=True)
    for name in _COPIED:
        _copy(ROOT / name, pages / name)
    for folder in ('docs', 'validation/results'):
        for path in sorted((ROOT / folder).rglob('*')):
            if path.suffix in _SUFFIXES:
                _copy(path, pages / path.relative_to(ROOT))
    for path in sorted((ROOT / 'spacerobot_ros' / 'schemas').glob('*.json')):
        _copy(path, pages / path.relative_to(ROOT))
    _write(pages / 'reference' / 'commands.md', '\n'.join(_commands()))
    _write(pages / 'reference' / 'catalogue.md', '\n'.join(_catalogue()))
    _write(pages / 'reference' / 'python.md', '\n'.join(_api()))
    site = yaml.safe_load((ROOT / 'mkdocs.yml').read_text(encoding='utf-8'))
    site['hooks'] = [str(ROOT / hook) for hook in site['hooks']]
    site['docs_dir'], site['site_dir'] = str(pages.absolute()), str((out / 'site').absolute())
    named = str(site['nav'])
    found = sorted(str(p.relative_to(pages)) for p in (pages / 'docs').rglob('*.md'))
    if more := [path for path in found if path not in named]:
        site['nav'].append({'More': more})
    handler = next(p for p in site['plugins'] if 'mkdocstrings' in p)['mkdocstrings']
    handler['handlers']['python']['paths'] = [str(ROOT)]
    _write(out / 'mkdocs.yml', yaml.safe_dump(site, sort_keys=False))
    print(out / 'mkdocs.yml')
    return 0


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding='utf-8')


def _commands() -> Iterator[str]:
    """Every command's help."""
    from click import Context

    from spacerobot_ros.cli.commands import COMMANDS, spacerobot

    os.environ['COLUMNS'] = _WIDTH
    root = Context(spacerobot, info_name='spacerobot', **spacerobot.context_settings)
    yield f'# Commands\n\n```\n{spacerobot.get_help(root)}\n```\n'
    for name in COMMANDS:
        command = importlib.import_module(f'spacerobot_ros.cli.{name}').run
        summary = command.get_short_help_str(1000)
        yield f'## spacerobot {name}\n\n{summary[:1].upper()}{summary[1:]}.\n'
        help_text = command.get_help(Context(command, info_name=name, parent=root))
        yield f'```\n{help_text}\n```\n'


def _catalogue() -> Iterator[str]:
    """Every effect with its parameters."""
    from spacerobot_ros.effects.catalogue import CATALOGUE
    from spacerobot_ros.model.schema import meanings

    yield '# Catalogue of effects\n\nEquations and magnitudes: [effects](../docs/effects.md).\n'
    for kind in CATALOGUE.values():
        yield f'## {kind.id}\n\n{kind.title[:1].upper()}{kind.title[1:]}.\n'
        if not kind.parameters:
            continue
        yield '| parameter | unit | least | most | plausible size | worth naming | meaning |'
        yield '|---|---|---|---|---|---|---|'
        said = meanings(kind)
        for p in kind.parameters:
            least = max(p.minimum, p.above)
            numbers = (f'{x:g}' for x in (least, p.maximum, p.size, p.relevant))
            yield f'| `{p.name}` | {p.unit or "1"} | {" | ".join(numbers)} | {said[p.name]} |'
        yield ''


def _api() -> Iterator[str]:
    """The public names."""
    import spacerobot_ros

    yield f'# Python\n\n{inspect.getdoc(spacerobot_ros)}\n'
    yield from (f'::: spacerobot_ros.{name}\n' for name in spacerobot_ros.PUBLIC)


if __name__ == '__main__':
    sys.exit(main())
