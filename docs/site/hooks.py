"""What the site needs beyond its theme: no page asks the network for anything."""

from __future__ import annotations

from typing import Any

SHIM = 'https://unpkg.com/iframe-worker/shim'
OWN = 'docs/site/iframe_worker.js'


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Name the theme's only remote script by its copy among the pages."""
    return output.replace(SHIM, '../' * page.url.count('/') + OWN)


def on_post_template(output: str, template_name: str, config: Any) -> str:
    """The same on pages without a source, such as 404."""
    return output.replace(SHIM, OWN)
