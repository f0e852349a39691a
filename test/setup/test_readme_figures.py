"""The README's figures come from a run."""

from __future__ import annotations

from pathlib import Path

import readme_figures

README = Path(__file__).resolve().parents[2] / 'README.md'
PRINTED = """noise before
Momentum of the captured wheels [N m s]
 link_3, x     40.0000
largest joint error    3.000 deg without
momentum drift         1e-14 relative
wall time              1 s
"""
FOUND = {
    'aam': {'max_error_percent': 0.0512},
    'tracking_max_deg': {'no_aam': 3.0004, 'identified': 0.0071},
}


def test_table_and_rows_are_replaced_and_all_else_is_kept():
    before = README.read_text(encoding='utf-8')
    after = readme_figures.with_figures(before, PRINTED, FOUND)
    assert '| 0.05 % | `make demo` |' in after
    assert '| 3.00 / 0.007 deg | `make demo` |' in after
    assert ' link_3, x     40.0000\n' in after
    assert 'wall time              1 s' not in after
    assert readme_figures.with_figures(after, PRINTED, FOUND) == after
    gone = set(before.splitlines()) - set(after.splitlines())
    assert len(gone) == 11  # nine lines of the table, two rows
