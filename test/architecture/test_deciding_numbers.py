"""Every number that decides stands in one table a room, with its reason."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import spacerobot_ros

PACKAGE = Path(spacerobot_ros.__file__).parent
TABLES = [PACKAGE / 'inference' / 'decisive.py', PACKAGE / 'diagnosis' / 'limits.py']
MOST = 40
PLAIN = {0, 1, 2, 0.5}
MODULES = sorted(
    path
    for room in ('inference', 'diagnosis')
    for path in (PACKAGE / room).rglob('*.py')
    if path not in TABLES
)


def numbers(node: ast.AST) -> list[float]:
    """Literals in an expression that are not plain; in index and shape they decide nothing."""
    return [
        n.value
        for n in ast.walk(node)
        if isinstance(n, ast.Constant)
        and isinstance(n.value, int | float)
        and not isinstance(n.value, bool)
        and n.value not in PLAIN
    ]


def deciding(tree: ast.AST) -> list[tuple[int, float]]:
    """Line and value of every other literal in a comparison or a default argument."""
    out = []
    for node in ast.walk(tree):
        parts: list[ast.AST] = []
        if isinstance(node, ast.Compare):
            parts = [node]
        elif isinstance(node, ast.FunctionDef | ast.Lambda):
            parts = [d for d in (*node.args.defaults, *node.args.kw_defaults) if d is not None]
        out += [(part.lineno, value) for part in parts for value in numbers(part)]
    return out


@pytest.mark.parametrize('path', MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_other_literal_decides(path):
    assert not deciding(ast.parse(path.read_text(encoding='utf-8')))


@pytest.mark.parametrize(
    'text', ['x > 3.0 * y', 'def f(a=0.1): pass', 'def f(*, a=7): pass', 'lambda a=1e-3: a']
)
def test_the_test_sees_literals(text):
    assert deciding(ast.parse(text))


def test_every_number_of_the_tables_has_its_reason():
    count = 0
    for table in TABLES:
        body = ast.parse(table.read_text(encoding='utf-8')).body
        for k, node in enumerate(body):
            if isinstance(node, ast.Assign):
                reason = body[k + 1]
                assert isinstance(reason, ast.Expr)
                assert isinstance(reason.value, ast.Constant)
                assert len(reason.value.value) > 40
                target = node.targets[0]
                count += len(target.elts) if isinstance(target, ast.Tuple) else 1
    assert 20 < count <= MOST
