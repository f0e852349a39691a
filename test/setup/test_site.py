"""The site of `make docs` in a real browser, from its folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.browser import Browser, needs_chromium

SITE = Path(__file__).resolve().parents[2] / 'out' / 'docs' / 'site'


@needs_chromium
@pytest.mark.tutorial
@pytest.mark.skipif(not (SITE / 'index.html').is_file(), reason='not built: make docs')
@pytest.mark.parametrize(('width', 'scheme'), [(400, 'dark'), (1600, 'light')])
def test_every_page_opens_without_an_error(width, scheme):
    pages = sorted(p for p in SITE.rglob('*.html') if p.name != '404.html')
    assert len(pages) > 40
    wrong = {}
    with Browser() as browser:
        for page in pages:
            browser.open(page, width, scheme)
            wide = browser.ask('document.documentElement.scrollWidth') > width
            if browser.errors or wide:
                wrong[str(page.relative_to(SITE))] = [*browser.errors, *['too wide'] * wide]
    assert wrong == {}
