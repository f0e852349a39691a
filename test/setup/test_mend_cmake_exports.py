"""Mending of the wheels' CMake exports."""

import os
import sysconfig
from pathlib import Path

import pytest
from mend_cmake_exports import PATTERN, mend_prefix, mend_text, numpy_include_of_this_python

PYTHON = '/opt/python/cp311-cp311/include/python3.11'
NUMPY = '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include'
EXPORT = """set_target_properties(x PROPERTIES
  INTERFACE_INCLUDE_DIRECTORIES "{}"
  INTERFACE_LINK_LIBRARIES "x__generator_c"
)
"""


def make_export(prefix: Path, package: str, folders: str) -> Path:
    path = prefix / 'share' / package / 'cmake' / PATTERN.replace('*', f'export_{package}')
    path.parent.mkdir(parents=True)
    path.write_text(EXPORT.format(folders), encoding='utf-8')
    return path


@pytest.mark.parametrize(
    ('folders', 'mended'),
    [
        (f'{PYTHON};{NUMPY}', '/here/py;/here/np'),
        (f'{PYTHON};${{_X}}/include;{NUMPY}', '/here/py;${_X}/include;/here/np'),
        ('/x/include/python3.13t;/x/numpy/core/include', '/here/py;/here/np'),
        ('/x/include/python3.10', '/here/py'),
        ('/x/include/other', '/x/include/other'),
        ('', ''),
    ],
)  # fmt: skip
def test_only_the_two_folders_are_replaced(folders, mended):
    assert mend_text(EXPORT.format(folders), '/here/py', '/here/np') == EXPORT.format(mended)


def test_second_run_changes_nothing(tmp_path):
    python, numpy = '/here/include/python3.12', '/here/numpy/_core/include'
    exports = [make_export(tmp_path, name, f'{PYTHON};{NUMPY}') for name in ('a_msgs', 'b_msgs')]
    assert mend_prefix(tmp_path, python, numpy) == exports
    assert exports[0].read_text(encoding='utf-8') == EXPORT.format(f'{python};{numpy}')
    assert mend_prefix(tmp_path, python, numpy) == []


def test_changes_from_one_interpreter_to_another(tmp_path):
    export = make_export(tmp_path, 'a_msgs', f'{PYTHON};{NUMPY}')
    for version in ('3.12', '3.13'):
        mend_prefix(tmp_path, f'/v/include/python{version}', f'/v{version}/numpy/_core/include')
    assert export.read_text(encoding='utf-8') == EXPORT.format(
        '/v/include/python3.13;/v3.13/numpy/_core/include'
    )


def test_a_hard_linked_cache_is_left_alone(tmp_path):
    export = make_export(tmp_path, 'a_msgs', f'{PYTHON};{NUMPY}')
    cached = tmp_path / 'cached'
    os.link(export, cached)
    mend_prefix(tmp_path, '/here/include/python3.12', '/here/numpy/_core/include')
    assert cached.read_text(encoding='utf-8') == EXPORT.format(f'{PYTHON};{NUMPY}')
    assert not list(tmp_path.rglob('*.draft'))


def test_include_folders_of_this_python_exist():
    assert (Path(numpy_include_of_this_python()) / 'numpy' / 'arrayobject.h').exists()
    assert (Path(sysconfig.get_path('include')) / 'Python.h').exists()
