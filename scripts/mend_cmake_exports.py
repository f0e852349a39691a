"""Point the CMake exports of the ROS 2 wheels' messages at this Python and this numpy.

The wheels of message packages carry `*__rosidl_generator_pyExport.cmake` files that name the
include folders of the machine they were built on (`/opt/python/cp311-...`). CMake refuses imported
targets with include folders that do not exist, so no package that depends on those messages can
be built before they are mended. Running it again changes nothing.

    python mend_cmake_exports.py [PREFIX]      # PREFIX: this interpreter's by default
"""

from __future__ import annotations

import importlib.util
import os
import re
import sys
import sysconfig
from pathlib import Path

PATTERN = '*__rosidl_generator_pyExport.cmake'
INCLUDES = re.compile(r'(INTERFACE_INCLUDE_DIRECTORIES ")([^"]*)(")')
PYTHON_INCLUDE = re.compile(r'/include/python3\.\d+\w?$')
NUMPY_INCLUDE = re.compile(r'/numpy/_?core/include$')


def mend_text(text: str, python_include: str, numpy_include: str) -> str:
    """Return the text of an export file with both include folders replaced; others are kept."""

    def mended(folder: str) -> str:
        if PYTHON_INCLUDE.search(folder):
            return python_include
        return numpy_include if NUMPY_INCLUDE.search(folder) else folder

    def replace(match: re.Match[str]) -> str:
        return match[1] + ';'.join(mended(folder) for folder in match[2].split(';')) + match[3]

    return INCLUDES.sub(replace, text)


def mend_prefix(prefix: Path, python_include: str, numpy_include: str) -> list[Path]:
    """Mend all export files under prefix/share.

    Files are replaced, never written in place: an installer may have hard-linked them to its
    cache, and a killed run must not leave half a file.

    Returns:
        The files that changed.
    """
    changed = []
    for path in sorted((prefix / 'share').glob(f'*/cmake/{PATTERN}')):
        text = path.read_text(encoding='utf-8')
        mended = mend_text(text, python_include, numpy_include)
        if mended != text:
            draft = path.with_suffix('.draft')
            draft.write_text(mended, encoding='utf-8')
            os.replace(draft, path)
            changed.append(path)
    return changed


def numpy_include_of_this_python() -> str:
    """Return numpy's include folder without importing numpy."""
    spec = importlib.util.find_spec('numpy')
    if spec is None or not spec.origin:
        raise FileNotFoundError('this Python has no numpy')
    package = Path(spec.origin).parent
    candidates = [package / core / 'include' for core in ('_core', 'core')]
    for candidate in candidates:
        if (candidate / 'numpy' / 'arrayobject.h').exists():
            return str(candidate)
    raise FileNotFoundError(f'no numpy/arrayobject.h under {candidates[0]}')


def main() -> int:
    """Mend the prefix given on the command line, or this interpreter's."""
    prefix = Path(sys.argv[1] if len(sys.argv) > 1 else sys.prefix)
    python_include = sysconfig.get_path('include')
    changed = mend_prefix(prefix, python_include, numpy_include_of_this_python())
    print(f'mended {len(changed)} CMake exports under {prefix / "share"}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
