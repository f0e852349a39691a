"""The house: which room may know which, what stays in its room, and names that mean one thing.

Who may import whom is `[tool.importlinter]` of pyproject.toml.
"""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

import grimp
import pytest
from importlinter.cli import lint_imports

ROOT = Path(__file__).parents[2]
PACKAGE = 'spacerobot_ros'
OUTSIDE = ('report', 'batch', 'demo', 'ros', 'nodes', 'cli')
"""Rooms that the page draws as one."""
MOST_FILES = 20
"""In one folder, so that a room shows at a glance what is in it."""


@cache
def sources() -> dict[str, tuple[ast.AST, ...]]:
    """Every module of the package with all nodes of its syntax tree."""
    out = {}
    for path in sorted((ROOT / PACKAGE).rglob('*.py')):
        parts = path.relative_to(ROOT).with_suffix('').parts
        name = '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)
        out[name] = tuple(ast.walk(ast.parse(path.read_text(encoding='utf-8'))))
    return out


@pytest.fixture(scope='module', autouse=True)
def _forgotten_at_the_end():
    """A million objects that every garbage collection of later tests would go through."""
    yield
    sources.cache_clear()


def is_package(name):
    return (ROOT / name.replace('.', '/') / '__init__.py').is_file()


def room_of(name):
    parts = name.split('.')
    return parts[1] if len(parts) > 1 else ''


def short(name):
    return name.removeprefix(f'{PACKAGE}.')


def test_imports_keep_the_contracts():
    assert lint_imports(config_filename=str(ROOT / 'pyproject.toml'), no_cache=True) == 0


def test_no_room_is_a_heap():
    files = Counter(name.rpartition('.')[0] for name in sources() if not is_package(name))
    assert not {short(room): n for room, n in files.items() if n > MOST_FILES}


def test_only_the_command_line_prints():
    printing = {
        short(name)
        for name, nodes in sources().items()
        if room_of(name) != 'cli'
        for node in nodes
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == 'print'
    }
    assert not printing


def test_no_function_has_eight_parameters():
    def count(function):
        a = function.args
        names = [arg.arg for arg in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
        return len([name for name in names if name not in ('self', 'cls')])

    long = {
        f'{short(name)}.{node.name}'
        for name, nodes in sources().items()
        for node in nodes
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and count(node) >= 8
    }
    # a command's function has its options
    assert not {name for name in long if not re.fullmatch(r'cli\.\w+\.run', name)}


def test_no_file_of_the_product_looks_like_a_test():
    stems = [name.split('.')[-1] for name in sources()]
    looks = [s for s in stems if s.startswith('test') or s.endswith('_test') or s == 'conftest']
    assert not looks


def types_of(nodes):
    """Names of classes, and of types that are written as `Spans = tuple[...]`."""
    for node in nodes:
        if isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            names = (target.id for target in node.targets if isinstance(target, ast.Name))
            yield from (name for name in names if re.match('_?[A-Z]+[a-z]', name))


def test_no_two_types_have_one_name():
    names = Counter(name for nodes in sources().values() for name in types_of(nodes))
    assert not {name for name, count in names.items() if count > 1}


def test_no_two_files_have_one_name():
    # a node and a command are named after what they run
    stems = Counter(
        name.split('.')[-1]
        for name in sources()
        if not is_package(name) and room_of(name) not in ('nodes', 'cli')
    )
    assert not {stem for stem, count in stems.items() if count > 1}


def page():
    return (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')


def reached(graph, start):
    seen, todo = set(), [start]
    while todo:
        new = graph[todo.pop()] - seen
        seen |= new
        todo += new
    return seen


def test_the_picture_of_the_rooms_is_what_they_know():
    arrows = {tuple(ends) for ends in re.findall(r'^ +(\w+) --> (\w+)$', page(), re.MULTILINE)}
    drawn = defaultdict(set)
    for one, other in arrows:
        drawn[one].add(other)
    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    modules = {name for name in graph.modules if is_package(f'{PACKAGE}.{room_of(name)}')}
    known = {
        tuple('outside' if room in OUTSIDE else room for room in (room_of(name), room_of(other)))
        for name in modules - {PACKAGE}
        for other in graph.find_modules_directly_imported_by(name) & (modules - {PACKAGE})
    }
    assert arrows <= known
    assert not {(a, b) for a, b in known if a != b and b not in reached(drawn, a)}


def test_the_page_names_files_that_exist():
    names = set(re.findall(r'`([\w/]+\.py)`', page()))
    folders = (ROOT / PACKAGE, ROOT / 'validation', Path(__file__).parent)
    files = [str(path) for folder in folders for path in folder.rglob('*.py')]
    assert not {name for name in names if sum(f.endswith(f'/{name}') for f in files) != 1}
