"""What a campaign's records come to."""

from __future__ import annotations

from typing import Any

from validation.campaigns import CAMPAIGNS


def missed(name: str, results: dict[str, Any]) -> list[str]:
    """Figures of a campaign that are not reached."""
    return [check.what for check in CAMPAIGNS[name].judge(results) if not check.is_met]
