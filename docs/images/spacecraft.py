"""Draw docs/images/spacecraft.png: `python docs/images/spacecraft.py out/demo/report.html`.

It is what Chromium shows of the report's 3D view; without Chromium the picture is kept.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
MOST = 150_000  # bytes


def main(report: Path) -> None:
    """Draw it."""
    sys.path.insert(0, str(HERE.parents[1] / 'test'))
    from support.browser import CHROMIUM, Browser

    picture = HERE / 'spacecraft.png'
    if CHROMIUM is None:
        sys.stderr.write(f'{picture} is kept: chromium is not installed\n')
        return
    with Browser() as browser:
        browser.open(report, 1000)
        browser.ask("document.querySelector('.view').style.background = '#131c2e'")  # packs well
        browser.picture(picture, '.view')
    if picture.stat().st_size > MOST:
        raise SystemExit(f'{picture}: {picture.stat().st_size} bytes, at most {MOST}')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
