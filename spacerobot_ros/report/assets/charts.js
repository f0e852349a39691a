/* Charts of a report: zoom by dragging or pinching, values under the cursor, linked time axes.
   Reads the <script type="application/json"> before every .live and fills it. */
'use strict';
const spacerobot = (() => {
  const DASHES = [[], [8, 4], [8, 3, 2, 3], [10, 3, 2, 3, 2, 3], [2, 3]];
  const MARKERS = ['solid', 'dashed', 'dashed', 'dashed', 'dotted'];
  const UNNAMED = { stroke: 'transparent', label: '', class: 'unnamed' };

  /** Numbers of a base64 text of little-endian float32; NaN becomes a gap. */
  function floats(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  const gaps = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));

  function css(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  const curveColor = (k) => css(`--curve-${k % 7}`);

  function axis(label, more) {
    const line = { stroke: () => css('--line'), width: 1 };
    return { label, stroke: () => css('--ink'), grid: line, ticks: line, labelSize: label ? 22 : 0, ...more };
  }

  /** Two fingers zoom the abscissa, as dragging does with a mouse; a double tap shows all. */
  function pinches(u) {
    let from = null;
    const places = (event) => Array.from(event.touches, (t) => u.posToVal(
      t.clientX - u.over.getBoundingClientRect().left, 'x')).sort((a, b) => a - b);
    u.over.addEventListener('touchstart', (event) => {
      if (event.touches.length === 2) from = { at: places(event), min: u.scales.x.min, max: u.scales.x.max };
    }, { passive: true });
    u.over.addEventListener('touchmove', (event) => {
      if (from === null || event.touches.length !== 2) return;
      event.preventDefault();
      const width = u.over.clientWidth;
      const x = Array.from(event.touches, (t) => (t.clientX - u.over.getBoundingClientRect().left) / width)
        .sort((a, b) => a - b);
      const span = (from.at[1] - from.at[0]) / Math.max(x[1] - x[0], 0.05);
      const min = from.at[0] - x[0] * span;
      u.setScale('x', { min, max: min + span });
    }, { passive: false });
    u.over.addEventListener('touchend', () => { from = null; });
  }

  /** One set of axes. panel: title, unit, abscissa, log, x, curves [{label, y, low, high, color, dash}],
      levels [[value, label]], spans [[from, to, label]]. */
  function chart(place, panel, sync, options = {}) {
    // magnitudes over many decades: exponents on an even scale, which the library bears for any
    const line = (y) => gaps(panel.log ? y.map(Math.log10) : y);
    const data = [panel.x], series = [{ label: panel.abscissa }], bands = [];
    const add = (y, more) => { data.push(y); series.push({ width: 1.5, points: { show: false }, ...more }); };
    const value = (u, v) => (v == null ? '-' : (panel.log ? 10 ** v : v).toPrecision(5));
    panel.curves.forEach((curve) => {
      const stroke = () => curveColor(curve.color);
      add(line(curve.y), { label: curve.label || 'value', stroke, dash: DASHES[curve.dash % 5], value });
      if (curve.high) {
        bands.push({ series: [series.length, series.length + 1], fill: () => `${stroke()}2e` });
        add(line(curve.high), UNNAMED);
        add(line(curve.low), UNNAMED);
      }
    });
    const { levels = [], spans = [] } = panel, nothing = Array.from(panel.x, () => null);
    levels.forEach(([level, label]) => add(line(panel.x.map(() => level)), {
      label, stroke: () => css('--soft'), width: 1, dash: [5, 3], value, class: label ? 'level' : 'unnamed' }));
    spans.forEach(([, , label]) => label && add(nothing, {
      label, stroke: 'transparent', fill: () => css('--span'), value: () => '', class: 'span' }));
    const shade = ({ ctx, bbox, valToPos }) => spans.forEach(([first, last]) => {
      const [from, to] = [first, last].map((t) => Math.min(Math.max(valToPos(t, 'x', true), bbox.left), bbox.left + bbox.width));
      ctx.fillStyle = css('--span');
      ctx.fillRect(from, bbox.top, to - from, bbox.height);
    });
    const fine = (u, values) => values.map((v) => (v == null ? '' : `${+v.toPrecision(6)}`));
    const powers = (u, values) => values.map((v) => (v == null ? ''
      : Number.isInteger(v) ? `1e${v}` : `${+(10 ** v).toPrecision(2)}`));
    const upright = { size: 66, space: 24 };
    const size = () => ({ width: Math.max(place.clientWidth, 200), height: options.height || 240 });
    const u = new uPlot({
      ...size(),
      title: panel.title,
      cursor: { sync: { key: sync }, drag: { x: true, y: false } },
      legend: { markers: { dash: (of, k) => MARKERS[DASHES.indexOf(series[k].dash)] || 'dashed' } },
      scales: { x: { time: false } },
      axes: [axis(options.is_last === false ? '' : panel.abscissa, { size: 34, values: fine }),
        axis(`[${panel.unit}]`, panel.log ? { ...upright, values: powers, incrs: [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50] }
          : { ...upright, values: fine })],
      series, bands,
      hooks: { drawClear: [shade], draw: options.draw || [], ready: [pinches] },
    }, data, place);
    u.root.querySelectorAll('.u-series.unnamed').forEach((row) => row.remove());
    new ResizeObserver(() => { if (place.clientWidth) u.setSize(size()); }).observe(place);
    ['(prefers-color-scheme: dark)', 'print'].forEach((media) => {
      matchMedia(media).addEventListener('change', () => u.redraw(false, true));
    });
    return u;
  }

  function figure(place) {
    const { abscissa, height, panels } = JSON.parse(place.previousElementSibling.textContent);
    panels.forEach((panel, k) => {
      const curves = panel.curves.map((c) => ({
        ...c, y: floats(c.y), high: c.high && floats(c.high), low: c.low && floats(c.low) }));
      chart(place.appendChild(document.createElement('div')),
        { ...panel, abscissa, x: Array.from(floats(panel.x)), curves }, abscissa,
        { height, is_last: k === panels.length - 1 });
    });
  }

  function start() {
    document.querySelectorAll('.live').forEach(figure);
  }
  document.addEventListener('DOMContentLoaded', start);
  return { floats, gaps, css, curveColor, chart };
})();
