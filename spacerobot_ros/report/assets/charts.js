/* Charts of a report: zoom by dragging or pinching, values under the cursor, linked time axes.
   Reads <script type="application/json"> of every figure.chart; the static picture beside it stays
   for print, and where this does not run. */
'use strict';
const spacerobot = (() => {
  const DASHES = [[], [8, 4], [8, 3, 2, 3], [10, 3, 2, 3, 2, 3], [2, 3]];

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
    const line = { stroke: css('--line'), width: 1 };
    return { label, stroke: css('--ink'), grid: line, ticks: line, labelSize: label ? 22 : 0, ...more };
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

  /** One set of axes. panel: title, unit, log, x, curves [{label, y, low, high, color, dash}]. */
  function chart(place, panel, sync, options = {}) {
    // magnitudes over many decades: exponents on an even scale, which the library bears for any
    const line = (y) => gaps(panel.log ? y.map(Math.log10) : y);
    const data = [panel.x], series = [{ label: panel.abscissa }], bands = [];
    panel.curves.forEach((curve) => {
      const stroke = () => curveColor(curve.color);
      const value = (u, v) => (v == null ? '-' : (panel.log ? 10 ** v : v).toPrecision(5));
      series.push({ label: curve.label || panel.title, stroke, width: 1.5, dash: DASHES[curve.dash % 5], value, points: { show: false } });
      data.push(line(curve.y));
      if (curve.high) {
        const hidden = { stroke: 'transparent', points: { show: false }, label: '', class: 'band' };
        bands.push({ series: [series.length, series.length + 1], fill: () => `${curveColor(curve.color)}2e` });
        series.push(hidden, hidden);
        data.push(line(curve.high), line(curve.low));
      }
    });
    const fine = (u, values) => values.map((v) => (v == null ? '' : `${+v.toPrecision(6)}`));
    const powers = (u, values) => values.map((v) => (v == null ? '' : `1e${v}`));
    const size = () => ({ width: Math.max(place.clientWidth, 200), height: options.height || 240 });
    const levels = (u) => {
      const { ctx, bbox } = u;
      ctx.save();
      ctx.strokeStyle = css('--soft');
      ctx.setLineDash([5, 3]);
      (panel.levels || []).forEach((level) => {
        const y = u.valToPos(panel.log ? Math.log10(level) : level, 'y', true);
        if (y < bbox.top || y > bbox.top + bbox.height) return;
        ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
      });
      ctx.restore();
    };
    const u = new uPlot({
      ...size(),
      title: panel.title,
      cursor: { sync: { key: sync }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [axis(options.is_last === false ? '' : panel.abscissa, { values: fine }),
        axis(`[${panel.unit}]`, panel.log ? { size: 66, values: powers, incrs: [1, 2, 5, 10, 20, 50] }
          : { size: 66, values: fine })],
      series, bands,
      hooks: { draw: [levels, ...(options.draw || [])], ready: [pinches] },
    }, data, place);
    u.root.querySelectorAll('.u-series.band').forEach((row) => row.remove());
    new ResizeObserver(() => { if (place.clientWidth) u.setSize(size()); }).observe(place);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      u.axes.forEach((a) => { a._stroke = null; });
      u.redraw(false, true);
    });
    return u;
  }

  function figure(element, index) {
    const content = JSON.parse(element.querySelector('script').textContent);
    const place = element.querySelector('.live');
    const sync = `${content.sync ?? index}`;
    place.replaceChildren();
    const x = content.panels.map((p) => p.x);
    content.panels.forEach((panel, k) => {
      const curves = panel.curves.map((c) => ({
        ...c, y: floats(c.y), high: c.high && floats(c.high), low: c.low && floats(c.low) }));
      chart(place.appendChild(document.createElement('div')),
        { ...panel, x: Array.from(floats(x[k])), curves }, sync, { is_last: k === content.panels.length - 1 });
    });
    element.classList.add('is-live');
  }

  function start() {
    document.querySelectorAll('figure.chart').forEach(figure);
  }
  document.addEventListener('DOMContentLoaded', start);
  return { floats, gaps, css, curveColor, chart };
})();
