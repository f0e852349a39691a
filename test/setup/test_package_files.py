"""Files that other tools read: messages, locked requirements, package manifests, launch file."""

import ast
import importlib.util
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MESSAGES = sorted((ROOT / 'msg_defs' / 'msg').glob('*.msg'))
LOCKS = sorted((ROOT / 'requirements').glob('*.txt'))
FIELD = re.compile(r'^(?P<type>[\w/]+(?:\[\d*\])?)\s+(?P<name>\w+)\s*(?:#(?P<comment>.*))?$')


def fields_of(path):
    """Return type, name and comment (with its continuation lines) of each field."""
    fields = []
    for line in path.read_text(encoding='utf-8').splitlines():
        if match := FIELD.match(line):
            fields.append([match['type'], match['name'], match['comment'] or ''])
        elif fields and re.match(r'^\s+#', line):
            fields[-1][2] += line.split('#', 1)[1]
    return fields


@pytest.mark.parametrize('path', MESSAGES, ids=lambda path: path.stem)
def test_every_message_field_says_what_it_is(path):
    for kind, name, comment in fields_of(path):
        assert comment.strip(), f'{path.name}: {name} has no comment'
        is_number = re.match(r'(float|u?int)\d+|geometry_msgs', kind)
        if is_number:
            assert re.search(r'\[[^\]]+\]', comment), f'{path.name}: {name} names no unit'
        if kind.endswith(']') and is_number:
            assert re.search(r'\([^)]*\)', comment), f'{path.name}: {name} names no shape'


def test_messages_of_the_contract_exist():
    assert {'Estimate', 'Tracking', 'Ledger'} <= {path.stem for path in MESSAGES}


@pytest.mark.parametrize('path', LOCKS, ids=lambda path: path.stem)
def test_locks_are_pinned_and_hashed_and_name_no_index(path):
    text = path.read_text(encoding='utf-8')
    assert not re.search(r'https?://|file:|--(extra-)?index|--find-links', text)
    for block in re.split(r'\n(?=\S)', text.strip()):
        assert re.match(r'^[\w.-]+(\[[\w,-]+\])?==', block), f'not pinned: {block[:60]}'
        assert '--hash=sha256:' in block, f'not hashed: {block[:60]}'


def test_locks_hold_what_the_project_asks_for():
    tomllib = pytest.importorskip('tomllib', reason='Python 3.11 or later')
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))

    def names(requirements):
        return {re.split(r'[<>=;\s]', name)[0] for name in requirements}

    def locked(name):
        text = (ROOT / 'requirements' / f'{name}.txt').read_text(encoding='utf-8')
        return set(re.findall(r'^([\w.-]+)==', text, re.MULTILINE))

    extras = {name: names(of) for name, of in project['project']['optional-dependencies'].items()}
    groups = {name: names(of) for name, of in project['dependency-groups'].items()}
    common = names(project['project']['dependencies']) | groups['tools']
    common |= extras['fleet'] | extras['test']
    assert common | extras['ros'] | groups['build'] <= locked('wheels')
    assert common - {'numpy'} <= locked('sourced')
    assert not {name for name in locked('sourced') if name == 'numpy' or name.startswith('ros-')}
    assert groups['build'] <= locked('colcon')
    assert extras['docs'] <= locked('docs')


def test_versions_agree():
    manifests = [ROOT / 'package.xml', ROOT / 'msg_defs' / 'package.xml']
    versions = {ElementTree.parse(path).findtext('version') for path in manifests}
    package = (ROOT / 'spacerobot_ros' / '__init__.py').read_text(encoding='utf-8')
    versions |= set(re.findall(r"__version__ = '([^']+)'", package))
    changes = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    versions.add(re.findall(r'^## \[(\d.*?)\] - \d{4}-\d\d-\d\d$', changes, re.MULTILINE)[0])
    assert len(versions) == 1


def test_every_ros_package_that_is_imported_is_declared():
    known = re.compile(r'^(\w+_msgs|std_srvs|builtin_interfaces|rclpy|launch|launch_ros)$')
    imported = set()
    for path in [*ROOT.glob('spacerobot_ros/**/*.py'), *ROOT.glob('launch/*.py')]:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                imported.add(node.module.split('.')[0])
    manifest = ElementTree.parse(ROOT / 'package.xml')
    declared = {element.text for element in manifest.findall('exec_depend')}
    assert {name for name in imported if known.match(name)} <= declared


def test_launch_file_describes_all_nodes():
    path = ROOT / 'launch' / 'closed_loop.launch.py'
    source = path.read_text(encoding='utf-8')
    compile(source, str(path), 'exec')
    assert {'simulator', 'identifier', 'controller', 'monitor'} <= set(
        re.findall(r"part\(\s*'(\w+)'", source)
    )
    if importlib.util.find_spec('launch_ros') is None:
        pytest.skip('only compiled: no launch_ros here')
    namespace: dict[str, object] = {}
    exec(compile(source, str(path), 'exec'), namespace)
    assert len(namespace['generate_launch_description']().entities) == 6
