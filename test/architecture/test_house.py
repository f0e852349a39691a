"""The house: which room may know which, what stays in its room, and names that mean one thing.

Read from the source text, so that imports inside functions and for type checkers count too.
"""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = 'spacerobot_ros'
LAYERS = (
    ('', 'errors', 'types', 'json_values', 'formats', 'display', 'interrupts', 'requirements'),
    ('model', 'inference'),
    ('dynamics',),
    ('effects',),
    ('sensing', 'recording'),
    ('estimation',),
    ('identification',),
    ('control',),
    ('simulation', 'excitation', 'diagnosis'),
    ('report', 'batch', 'demo', 'ros', 'nodes', 'cli'),
)
"""Rooms and modules beside them, lowest first: each may know its own layer and those below."""
ROS = ('rclpy', 'launch', 'launch_ros', 'rosidl_runtime_py', 'ament_index_python', 'rpyutils')
MOST_FILES = 20
"""In one folder, so that a room shows at a glance what is in it."""
MESSAGES = ('_msgs', '_srvs', '_interfaces')


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


def imports(name):
    """Full names that a module imports, anywhere in it."""
    for node in sources()[name]:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = name.split('.')
            up = node.level - is_package(name)
            base = base[: len(base) - up] if node.level else []
            whole = '.'.join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f'{whole}.{alias.name}'
                yield inner if inner in sources() else whole


@cache
def file_graph():
    return {
        name: {other for other in imports(name) if other in sources() and other != name}
        for name in sources()
    }


def room_of(name):
    parts = name.split('.')
    return parts[1] if len(parts) > 1 else ''


def inner_room_of(name):
    """The folder of a file; of a file beside inner rooms, itself."""
    parts = name.split('.')[1:]
    return '.'.join(parts if is_package(name) or len(parts) < 3 else parts[:-1])


def graph_of(rooms):
    graph = defaultdict(set)
    for name, others in file_graph().items():
        graph[rooms(name)] |= {rooms(o) for o in others} - {rooms(name)}
    return dict(graph)


@cache
def room_graph():
    return graph_of(room_of)


def reached(graph, start):
    seen, todo = set(), [start]
    while todo:
        for other in graph.get(todo.pop(), ()):
            if other not in seen:
                seen.add(other)
                todo.append(other)
    return seen


def circles(graph):
    """Nodes that reach each other."""
    ahead = {node: reached(graph, node) for node in graph}
    return {
        tuple(sorted({node, *(o for o in ahead[node] if node in ahead.get(o, ()))}))
        for node in graph
        if node in ahead[node]
    }


def short(circle):
    return tuple(name.removeprefix(f'{PACKAGE}.') for name in circle)


def test_no_circle_of_files():
    assert not {short(c) for c in circles(file_graph())}


def test_no_circle_of_rooms():
    assert not circles(room_graph())


def test_no_circle_of_inner_rooms():
    assert not circles(graph_of(inner_room_of))


def test_no_room_is_a_heap():
    files = Counter(name.rpartition('.')[0] for name in sources() if not is_package(name))
    assert not {short((room,))[0]: n for room, n in files.items() if n > MOST_FILES}


def test_every_room_has_its_layer():
    known = {room for layer in LAYERS for room in layer}
    assert {room_of(name) for name in sources()} <= known


def test_imports_go_downwards():
    rank = {room: i for i, layer in enumerate(LAYERS) for room in layer}
    upwards = {
        short((name, other))
        for name, others in file_graph().items()
        for other in others
        if rank[room_of(other)] > rank[room_of(name)]
    }
    assert not upwards


def is_ros(name):
    top = name.split('.')[0]
    return top in ROS or top.endswith(MESSAGES)


@pytest.mark.parametrize(
    ('what', 'belongs', 'rooms'),
    [
        ('ROS', is_ros, ('ros', 'nodes')),
        ('plotting', lambda name: name.split('.')[0] == 'matplotlib', ()),
    ],
)
def test_what_belongs_to_a_room_stays_there(what, belongs, rooms):
    outside = {
        short((name,))[0]
        for name in sources()
        if room_of(name) not in rooms and any(belongs(other) for other in imports(name))
    }
    assert not outside, what


def test_only_the_command_line_prints():
    printing = {
        short((name,))[0]
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
        f'{short((name,))[0]}.{node.name}'
        for name, nodes in sources().items()
        for node in nodes
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and count(node) >= 8
    }
    assert not long


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


def test_the_picture_of_the_rooms_is_what_they_know():
    lowest, outside = LAYERS[0], LAYERS[-1]
    arrows = {tuple(ends) for ends in re.findall(r'^ +(\w+) --> (\w+)$', page(), re.MULTILINE)}
    drawn = defaultdict(set)
    for one, other in arrows:
        drawn[one].add(other)
    known = {
        ('outside' if one in outside else one, 'outside' if other in outside else other)
        for one, others in room_graph().items()
        for other in others
        if not {one, other} & set(lowest)
    }
    assert arrows <= known
    assert not {(a, b) for a, b in known if a != b and b not in reached(drawn, a)}


def test_the_page_names_files_that_exist():
    names = set(re.findall(r'`([\w/]+\.py)`', page()))
    folders = (ROOT / PACKAGE, Path(__file__).parent)
    files = [str(path) for folder in folders for path in folder.rglob('*.py')]
    assert not {name for name in names if sum(f.endswith(f'/{name}') for f in files) != 1}
