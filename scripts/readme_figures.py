"""Write into README.md what `make demo` prints and finds today, and draw its spacecraft.

python scripts/readme_figures.py          # runs the demonstration; keeps all other lines
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
_FIRST, _LAST = 'Momentum of the captured wheels', 'momentum drift'


def main() -> int:
    """Run and rewrite."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / 'demo'
        command = [sys.executable, '-m', 'spacerobot_ros.cli.main', 'demo', '--out', str(out)]
        printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
        found = json.loads((out / 'summary.json').read_text(encoding='utf-8'))
        drawing = [sys.executable, 'docs/images/spacecraft.py', str(out / 'report.html')]
        subprocess.run(drawing, cwd=ROOT, check=True)
    path = ROOT / 'README.md'
    text = with_figures(path.read_text(encoding='utf-8'), printed.stdout, found)
    path.write_text(text, encoding='utf-8')
    print(f'written: {path}')
    return 0


def with_figures(readme: str, printed: str, found: dict[str, Any]) -> str:
    """The README with the demonstration's table and the figures made of it.

    Args:
        readme: As it is.
        printed: What the demonstration printed.
        found: Its `summary.json`.
    """
    readme = readme.replace(_table(readme), _table(printed))
    error, tracked = found['aam']['max_error_percent'], found['tracking_max_deg']
    figures = {
        'error of the wheel momentum after': f'{error:.1g} %',
        'largest joint error, wheels unknown': (
            f'{tracked["no_aam"]:.2f} / {tracked["identified"]:.1g} deg'
        ),
    }
    for name, value in figures.items():
        readme, count = re.subn(rf'(\| {name}[^|]*\| )[^|]*( \|)', rf'\g<1>{value}\g<2>', readme)
        if count != 1:
            raise SystemExit(f'README.md: the row of {name!r} stands {count} times')
    return readme


def _table(text: str) -> str:
    """From the heading to the momentum's drift, as it stands there."""
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(_FIRST))
    last = next(k for k, line in enumerate(lines) if line.startswith(_LAST))
    return '\n'.join(lines[first : last + 1])


if __name__ == '__main__':
    sys.exit(main())
