"""Pages in a real browser: no error, pictures that move, curves that can be read."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from support.browser import Browser, needs_chromium
from support.models import random_tree, settings_of, to_urdf

from spacerobot_ros.display import Curve, Panel, Plot, Replay, Report, Section
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.recording.record import JointSeries, Record
from spacerobot_ros.report.html import render
from spacerobot_ros.simulation.replay.scene import scene_of

HOSTILE = '</script><img src=x onerror="document.title=1"><script>document.title="taken"</script>'


@pytest.fixture(scope='module')
def scene():
    """A minute of seven joints at 100 Hz, the robot file naming the outermost first."""
    rng = np.random.default_rng(1)
    parts = random_tree(rng, [0, 1, 2, 3, 4, 5, 6])
    settings = settings_of(parts, [part.joint for part in parts[:0:-1]], base='fixed')
    file = RobotFile(build_robot(settings, to_urdf(parts)), settings)
    time = np.arange(0.0, 60.0, 0.01)
    n = file.robot.n_joints
    q = 0.6 * np.sin(np.outer(time, rng.uniform(0.3, 1.0, n)))
    joints = JointSeries(file.robot.joints, np.round(time * 1e9).astype(np.int64), q)
    marks = [(file.robot.joints[0], text) for text in (HOSTILE, 'another', 'a third')]
    return scene_of(Record(joints), file, marks)


@pytest.fixture(scope='module')
def page(scene, tmp_path_factory):
    """A replay and two plots, everything named by somebody who means harm."""
    time = np.linspace(0.0, 60.0, 2001)
    half = time[::2]
    curves = [Curve(HOSTILE, time, np.sin(time), np.full(2001, 5.0)), Curve('b', half, half)]
    below = Panel(
        'below', '1', curves[1:], levels=((30.0, 'limit'),), spans=((10.0, 20.0, 'event'),)
    )
    plots = [
        Plot([Panel(HOSTILE, 'rad', curves), below]),
        Plot([Panel('error', 'm', [Curve('', time, np.exp(-time))], log=True)]),
    ]
    sections = [Section(HOSTILE, [HOSTILE, Replay(scene, HOSTILE), *plots])]
    path = tmp_path_factory.mktemp('page') / 'page.html'
    path.write_text(render(Report(HOSTILE, HOSTILE, sections)), encoding='utf-8')
    return path


@pytest.fixture(scope='module')
def browser():
    with Browser() as running:
        yield running


def test_a_minute_of_seven_joints_is_a_small_page_of_its_own(page):
    text = page.read_text(encoding='utf-8')
    assert len(text) < 5e6
    assert 'src="http' not in text
    assert 'href="http' not in text
    assert '<script src' not in text


@needs_chromium
@pytest.mark.parametrize(('width', 'scheme'), [(400, 'dark'), (1600, 'light')])
def test_the_page_opens_without_an_error(page, browser, width, scheme):
    browser.open(page, width, scheme)
    assert browser.errors == []
    assert browser.ask("document.querySelectorAll('figure.is-live').length") == 1
    assert browser.ask("document.querySelectorAll('.live .uplot').length") == 3
    assert browser.ask('document.documentElement.scrollWidth') <= width
    assert browser.ask('document.title') == HOSTILE
    assert browser.ask("document.querySelectorAll('img').length") == 0


@needs_chromium
def test_curves_bands_levels_and_spans_are_drawn(page, browser):
    browser.open(page)
    seen = browser.ask("""[...document.querySelectorAll('.live canvas')].map((canvas) => {
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        const count = (...color) => {
            let found = 0;
            for (let k = 0; k < data.length; k += 4)
                found += color.every((value, c) => Math.abs(data[k + c] - value) < 8);
            return found;
        };
        const [first, second] = [[0, 114, 178], [213, 94, 0]];
        return { first: count(...first, 255), second: count(...second, 255),
            band: count(...first, 46), level: count(89, 99, 110, 255),
            span: count(217, 130, 0, 51) };
    })""")
    drawn = [{name for name, pixels in chart.items() if pixels > 200} for chart in seen]
    assert drawn == [{'first', 'second', 'band'}, {'first', 'level', 'span'}, {'first'}]
    names = browser.ask("""[...document.querySelectorAll('.live .u-legend')].map((legend) =>
        [...legend.querySelectorAll('.u-label')].map((label) => label.textContent))""")
    time = 'time [s]'
    assert names == [[time, HOSTILE, 'b'], [time, 'b', 'limit', 'event'], [time, 'value']]


@needs_chromium
def test_paper_shows_whole_charts_in_light_colors(page, browser):
    browser.open(page, 1200, 'dark', 'print')
    count, widest, ink = browser.ask("""(() => {
        document.body.style.width = '700px';  // as a sheet: nothing draws anew for it
        const charts = [...document.querySelectorAll('.live canvas')], [{ height }] = charts;
        const { data } = charts[0].getContext('2d').getImageData(0, 0, 80, height);
        const words = data.filter((_, k) => k % 4 === 0 && data[k + 3] === 255);
        const edges = charts.map((chart) => chart.getBoundingClientRect().right);
        return [charts.length, Math.max(...edges), Math.min(...words)];
    })()""")
    assert count == 3
    assert widest <= 700
    assert ink < 60


@needs_chromium
def test_words_at_bodies_can_be_read_and_none_covers_another(page, browser):
    browser.open(page)
    boxes = browser.ask("""(() => {
        const view = document.querySelector('.view').getBoundingClientRect();
        return [...document.querySelectorAll('.mark')].map((mark) => {
            const { top, bottom } = mark.getBoundingClientRect(), style = getComputedStyle(mark);
            return [top - view.top, bottom - view.top, parseFloat(style.fontSize)];
        });
    })()""")
    assert len(boxes) == 3  # all at one body
    assert min(size for _, _, size in boxes) >= 12.0
    boxes.sort()
    assert boxes[0][0] >= 0.0
    assert all(above[1] < below[0] for above, below in pairwise(boxes))


@needs_chromium
def test_the_picture_moves_with_the_slider_and_plays(page, browser):
    browser.open(page)
    same, other = browser.ask("""(() => {
        const { replay } = document.querySelector('figure.replay');
        const slider = document.querySelector('figure.replay .time');
        const seen = (k) => { slider.value = k; slider.oninput(); replay.draw();
            return replay.canvas.toDataURL(); };
        const first = seen(0);
        return [first === seen(0), first !== seen(900)];
    })()""")
    assert same
    assert other
    time = browser.ask("""new Promise((done) => {
        const figure = document.querySelector('figure.replay');
        figure.querySelector('select').value = 10;
        figure.querySelector('button').click();
        const wait = () => (Number(figure.querySelector('.time').value) > 200
            ? done(figure.querySelector('output').textContent) : requestAnimationFrame(wait));
        wait();
    })""")
    assert float(time.removesuffix(' s')) > 6.6
    assert browser.errors == []


@needs_chromium
def test_linked_axes_zoom_together_and_values_can_be_read(page, browser):
    browser.open(page, 1200)
    left, width, y = browser.ask("""(() => {
        const over = document.querySelector('figure.plot .u-over');
        over.scrollIntoView();
        const box = over.getBoundingClientRect();
        return [box.left, box.width, box.top + 50];
    })()""")
    times = """[...document.querySelectorAll('figure.plot .uplot')].map(
        (chart) => chart.querySelector('.u-legend .u-value').textContent)"""
    browser.drag((left + 0.5 * width, y))
    before = browser.ask(times)
    browser.drag(*((left + share * width, y) for share in (0.25, 0.4, 0.5)))
    browser.drag((left + 0.5 * width, y))
    after = browser.ask(times)
    read = browser.ask("document.querySelectorAll('figure.plot .u-value')[1].textContent")
    assert [float(t) for t in before] == pytest.approx([30.0] * 3, abs=0.5)
    # the middle of what was dragged over, 15 s to 30 s, on all three
    assert [float(t) for t in after] == pytest.approx([22.5] * 3, abs=0.5)
    assert float(read) == pytest.approx(np.sin(22.5), abs=0.2)
