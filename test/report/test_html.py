"""Reports stand alone, escape what they are given, and come out the same each time."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest

from spacerobot_ros.display import (
    Curve,
    KeyFigure,
    KeyFigures,
    Panel,
    Plot,
    Report,
    Section,
    Table,
)
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.report.html import render, write_report
from spacerobot_ros.report.plots import plot

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


def report(svg='<svg></svg>'):
    figures = [
        KeyFigure('AAM error', '0.13', '%', 'below 1 %', 'good'),
        KeyFigure('drift', '2e-3', '', '', 'bad'),
    ]
    table = Table(['name', 'value [kg m^2]'], [['J<1>', '2.3 ± 0.1'], ['all', 'none']], 'Found')
    sections = [
        Section('Key figures', [KeyFigures(figures), 'a < b & "c"']),
        Section('Data', [table, Plot(svg, 'What to see')]),
    ]
    return Report('Loop & <tag>', 'seed 1', sections)


def example_plot():
    t = np.linspace(0.0, 20.0, 5001)
    estimate = Curve('estimate', t, 42 + np.exp(-t), half_band=3 * np.exp(-t))
    return plot(
        [
            Panel(
                'Joint error', 'deg', [Curve('a', t, np.sin(t)), Curve('b', t, 0 * t)], log=True
            ),
            Panel('Momentum', 'N m s', [estimate], levels=[(42.0, 'truth')]),
        ]
    )


def test_the_page_nests_and_needs_no_network():
    page = Page(render(report(example_plot())))
    assert not {'script', 'link', 'iframe', 'img'} & set(page.tags)
    links = [v for k, v in page.attributes if k in ('src', 'href', 'xlink:href')]
    assert all(v.startswith('#') for v in links)
    assert ('name', 'viewport') in page.attributes
    assert page.tags.count('h1') == 1
    assert '@media print' in ''.join(page.text)


def test_content_is_escaped():
    text = render(report())
    assert 'Loop &amp; &lt;tag&gt;' in text
    assert 'a &lt; b &amp; &quot;c&quot;' in text
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
    assert render(report(example_plot())) == render(report(example_plot()))


def test_identifiers_are_only_those_that_are_used():
    svg = example_plot()
    page = Page(svg)
    used = {v[1:] for k, v in page.attributes if k.endswith('href')}
    used |= {v[5:-1] for k, v in page.attributes if v and v.startswith('url(#')}
    assert {v for k, v in page.attributes if k == 'id'} <= used


def test_writing_makes_the_folder_and_reports_what_fails(tmp_path):
    path = write_report(report(), tmp_path / 'out' / 'report.html')
    assert path.read_text(encoding='utf-8') == render(report())
    with pytest.raises(ConfigurationError, match=r'report\.html/x\.html: can not be written'):
        write_report(report(), path / 'x.html')


def test_a_picture_that_fails_costs_that_picture_only():
    def draw():
        raise ZeroDivisionError('no <data>')

    pictures = Section('Two', [Plot(draw, 'lost'), Plot(lambda: '<svg></svg>', 'kept')])
    text = render(Report('t', 's', [pictures]))
    assert 'This picture could not be drawn: ZeroDivisionError: no &lt;data&gt;' in text
    assert '<figure><svg></svg><figcaption>kept</figcaption></figure>' in text
