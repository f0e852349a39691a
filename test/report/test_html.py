"""Reports stand alone, escape what they are given, and come out the same each time."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest

from spacerobot_ros.display import (
    Curve,
    KeyFigure,
    KeyFigures,
    Matrix,
    Panel,
    Plot,
    Report,
    Section,
    Table,
)
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.report.html import render, write_report

VOID = {'meta', 'br', 'hr', 'img', 'link', 'input'}


class Page(HTMLParser):
    """Collects tags and attributes, and refuses a page whose tags don't nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.attributes, self.text = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def report(*items):
    figures = [
        KeyFigure('AAM error', '0.13', '%', 'below 1 %', 'good'),
        KeyFigure('drift', '2e-3', '', '', 'bad'),
    ]
    table = Table(['name', 'value [kg m^2]'], [['J<1>', '2.3 ± 0.1'], ['all', 'none']], 'Found')
    sections = [
        Section('Key figures', [KeyFigures(figures), 'a < b & "c"']),
        Section('Data', [table, *items]),
    ]
    return Report('Loop & <tag>', 'seed 1', sections)


def example_items():
    t = np.linspace(0.0, 20.0, 5001)
    estimate = Curve('estimate', t, 42 + np.exp(-t), half_band=3 * np.exp(-t))
    errors = [Curve('a', t, np.sin(t)), Curve('b', t, 0 * t)]
    panels = [
        Panel('Joint error', 'deg', errors, log=True),
        Panel('Momentum', 'N m s', [estimate], levels=[(42.0, 'truth')]),
    ]
    counts = Matrix(['<a>', 'b'], ['x', 'y'], np.array([[3, 1], [0, 0]]), 'named first')
    return [Plot(panels, 'What to see'), Plot(lambda: counts)]


def test_the_page_nests_and_needs_no_network():
    page = Page(render(report(*example_items())))
    assert not {'link', 'iframe', 'img'} & set(page.tags)
    assert not [v for k, v in page.attributes if k in ('src', 'href', 'xlink:href')]
    assert ('name', 'viewport') in page.attributes
    assert page.tags.count('h1') == 1
    assert page.tags.count('noscript') == 1
    assert '@media print' in ''.join(page.text)


def test_a_page_without_curves_has_no_script():
    curves, *tables = example_items()
    assert 'script' not in Page(render(report(*tables))).tags
    assert 'script' in Page(render(report(curves))).tags


def test_counts_are_shaded_by_their_row():
    text = render(report(example_items()[1]))
    assert '<td style="--share: 0.750">3</td><td style="--share: 0.250">1</td>' in text
    assert '<th scope="row">b</th><td></td><td></td>' in text


def test_content_is_escaped():
    text = render(report())
    assert 'Loop &amp; &lt;tag&gt;' in text
    assert 'a &lt; b &amp; &#34;c&#34;' in text
    assert 'J&lt;1&gt;' in text
    assert '<tag>' not in text


def test_status_is_marked_by_a_sign_not_by_color_alone():
    text = render(report())
    assert '<i class="good">&#10003;</i>' in text
    assert '<i class="bad">&#10007;</i>' in text


def test_numbers_are_aligned_and_words_are_not():
    text = render(report())
    assert '<td class="number">2.3 ± 0.1</td>' in text
    assert '<td>none</td>' in text


def test_the_same_content_gives_the_same_page():
    assert render(report(*example_items())) == render(report(*example_items()))


def test_writing_makes_the_folder_and_reports_what_fails(tmp_path):
    path = write_report(report(), tmp_path / 'out' / 'report.html')
    assert path.read_text(encoding='utf-8') == render(report())
    with pytest.raises(ConfigurationError, match=r'report\.html/x\.html: can not be written'):
        write_report(report(), path / 'x.html')


def test_a_picture_that_fails_costs_that_picture_only():
    def draw():
        raise ZeroDivisionError('no <data>')

    text = render(Report('t', 's', [Section('Two', [Plot(draw, 'lost'), *example_items()[1:]])]))
    assert 'This picture could not be drawn: ZeroDivisionError: no &lt;data&gt;' in text
    assert '<table class="matrix"' in text
