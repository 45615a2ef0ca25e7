// One picture: axes, grid, curves, a legend beside or below them, and the values at the point next to the pointer.
// plot(figure, spec) draws it as wide as the figure and returns what an animation draws on.
//   spec  { name, x, y, series, equal, legend }
//   axis  { label, log, plain, categories, include }: plain numbers, not powers of ten, on a logarithmic axis;
//         categories are names at 0, 1, 2, …; include are values that are shown too
//   series { label, colour, marker, dash, line, points: [{ x, y, tip }] }
// Colours are var(--…) of the style sheet, so they follow the colour scheme and the paper without being drawn again.
'use strict';
const Plot = (() => {
  const fontSize = 13, tick = 5, gap = 8, superscripts = '⁰¹²³⁴⁵⁶⁷⁸⁹';
  const font = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
  const pen = document.createElement('canvas').getContext('2d');

  function make(name, attributes, parent, text) {
    const node = document.createElementNS('http://www.w3.org/2000/svg', name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    if (parent) parent.append(node);
    return node;
  }

  function widthOf(text) {
    pen.font = `${fontSize}px ${font}`;
    return pen.measureText(text).width;
  }

  const power = n => '10' + (n < 0 ? '⁻' : '') + [...String(Math.abs(n))].map(d => superscripts[d]).join('');

  const scientific = (digit, n) => digit === 1 ? power(n) : `${digit}·${power(n)}`;
  const plain = (digit, n) => String(Number((digit * 10 ** n).toPrecision(1)));

  function decades(low, high, most, name) {
    const first = Math.ceil(low - 1e-9), last = Math.floor(high + 1e-9);
    if (last - first < 2) return fewDecades(low, high, name);
    const step = Math.max(1, Math.ceil((last - first + 1) / most));
    const ticks = [];
    for (let n = Math.ceil(first / step) * step; n <= last; n += step) ticks.push({ at: n, label: name(1, n) });
    return ticks;
  }

  function fewDecades(low, high, name) {
    const ticks = [];
    for (let n = Math.floor(low); n <= high; ++n)
      for (const digit of [1, 2, 5]) {
        const at = n + Math.log10(digit);
        if (at >= low && at <= high) ticks.push({ at, label: name(digit, n) });
      }
    return ticks;
  }

  function linearTicks(low, high, most) {
    const rough = (high - low) / Math.max(2, most), unit = 10 ** Math.floor(Math.log10(rough));
    const step = unit * [1, 2, 5, 10].find(factor => factor * unit >= rough * 0.999);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
      ticks.push({ at: k * step, label: String(Number((k * step).toPrecision(10))).replace('-', '−') });
    return ticks;
  }

  const extent = values => values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);

  // The values of an axis as they lie on it, and how far it reaches.
  function scale(axis, values) {
    const place = axis.log ? Math.log10 : value => value;
    const all = values.concat(axis.include || []).filter(v => Number.isFinite(v) && (!axis.log || v > 0)).map(place);
    const [low, high] = all.length ? extent(all) : [0, 1];
    const margin = axis.log ? Math.max(0.04 * (high - low), (1.1 - (high - low)) / 2)  // a tick at least
      : high > low ? 0.04 * (high - low) : Math.abs(low) / 2 || 0.5;
    return { place, low: low - margin, high: high + margin };
  }

  function ticksOf(axis, range, length, spacing) {
    if (axis.categories) return axis.categories.map((label, at) => ({ at, label }));
    const most = Math.max(2, Math.floor(length / spacing));
    const ticks = axis.log ? decades(range.low, range.high, most, axis.plain ? plain : scientific)
      : linearTicks(range.low, range.high, most);
    return ticks.filter(t => t.at >= range.low && t.at <= range.high);
  }

  // Leaves out labels that would touch the one before, what is left of `from` or the edge of the picture.
  function apart(ticks, at, from, width) {
    let end = from - gap;
    return ticks.filter(t => {
      const half = widthOf(t.label) / 2;
      if (at(t.at) - half < end + gap || at(t.at) + half > width) return false;
      end = at(t.at) + half;
      return true;
    });
  }

  const shapes = [
    r => `M${-r},0a${r},${r} 0 1,0 ${2 * r},0a${r},${r} 0 1,0 ${-2 * r},0`,
    r => `M${-r},${-r}h${2 * r}v${2 * r}h${-2 * r}z`,
    r => `M0,${-1.2 * r}L${1.1 * r},${0.8 * r}H${-1.1 * r}z`,
    r => `M0,${-1.3 * r}L${1.3 * r},0L0,${1.3 * r}L${-1.3 * r},0z`,
    r => `M0,${1.2 * r}L${1.1 * r},${-0.8 * r}H${-1.1 * r}z`,
    r => `M${-r},${-r}L${r},${r}M${r},${-r}L${-r},${r}`,
  ];
  function mark(series, x, y, parent) {
    const shape = shapes[series.marker % shapes.length](series.size || 3.6), cross = series.marker % shapes.length === 5;
    const fill = series.hollow || cross ? 'var(--paper)' : series.colour;
    make('path', { d: shape, transform: `translate(${x},${y})`,
      style: `fill:${fill};stroke:${series.colour};stroke-width:1.6` }, parent);
  }
  const stroke = series => `fill:none;stroke:${series.colour};stroke-width:${series.width || 1.8};` +
    `stroke-linejoin:round;stroke-dasharray:${series.dash || 'none'}`;

  // Where the keys of the legend go: one below the other at the right, or in columns below.
  function arrange(series, width, beside) {
    const key = 34, widest = Math.max(...series.map(s => widthOf(s.label))) + key + 18, row = 20;
    const columns = beside ? 1 : Math.max(1, Math.floor(width / widest)), rows = Math.ceil(series.length / columns);
    return { width: widest, height: rows * row + gap, key,
      at: i => ({ x: Math.floor(i / rows) * widest, y: (i % rows) * row }) };
  }

  function legend(svg, series, layout, x, y, curves) {
    const group = make('g', { class: 'legend' }, svg);
    series.forEach((s, i) => {
      const at = layout.at(i), node = make('g', { class: 'key', transform: `translate(${x + at.x},${y + at.y})` }, group);
      if (s.line !== false) make('path', { d: 'M0,9H24', style: stroke(s) }, node);
      if (s.marker !== undefined) mark(s, 12, 9, node);
      make('text', { x: layout.key - 4, y: 13.5, style: 'fill:var(--ink)' }, node, s.label);
      node.addEventListener('pointerenter', () => curves.forEach((c, k) => c.classList.toggle('dim', k !== i)));
      node.addEventListener('pointerleave', () => curves.forEach(c => c.classList.remove('dim')));
    });
  }

  function drawAxes(svg, spec, area, at, ticks, narrow) {
    const label = (x, y, text, anchor, extra) => make('text', { x, y, 'text-anchor': anchor, class: 'tick',
      style: 'fill:var(--muted)', ...extra }, svg, text);
    for (const t of ticks.x) {
      make('path', { d: `M${at.x(t.at)},${area.top}V${area.bottom}`, style: 'stroke:var(--grid)' }, svg);
      if (t.label) label(at.x(t.at), area.bottom + tick + fontSize, t.label, 'middle');
    }
    for (const t of ticks.y) {
      make('path', { d: `M${area.left},${at.y(t.at)}H${area.right}`, style: 'stroke:var(--grid)' }, svg);
      if (spec.y.categories && narrow) label(area.left, at.y(t.at) - 9, t.label, 'start',
        { 'paint-order': 'stroke', stroke: 'var(--paper)', 'stroke-width': 5 });
      else label(area.left - tick - 3, at.y(t.at) + 4.5, t.label, 'end');
    }
    make('path', { d: `M${area.left},${area.top}V${area.bottom}H${area.right}`,
      style: 'fill:none;stroke:var(--muted)' }, svg);
    make('text', { x: (area.left + area.right) / 2, y: area.bottom + 2 * fontSize + 14, 'text-anchor': 'middle',
      class: 'axis', style: 'fill:var(--ink)' }, svg, spec.x.label);
    if (spec.y.label)
      make('text', { transform: `translate(${fontSize},${(area.top + area.bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle',
        class: 'axis', style: 'fill:var(--ink)' }, svg, spec.y.label);
  }

  function drawCurves(svg, spec, at, area, ranges) {
    const clip = `clip-${spec.name}`;
    const box = make('clipPath', { id: clip }, make('defs', {}, svg));
    make('rect', { x: area.left - 6, y: area.top - 6, width: area.right - area.left + 12,
      height: area.bottom - area.top + 12 }, box);
    const layer = make('g', { 'clip-path': `url(#${clip})` }, svg);
    const seen = [];
    const curves = spec.series.map(series => {
      const group = make('g', { class: 'series' }, layer);
      const points = series.points.map(p => ({ x: at.x(ranges.x.place(p.x)), y: at.y(ranges.y.place(p.y)), tip: p.tip, series }));
      if (series.line !== false && points.length)
        make('path', { d: 'M' + points.map(p => `${p.x.toFixed(1)},${p.y.toFixed(1)}`).join('L'), style: stroke(series) }, group);
      if (series.marker !== undefined) points.forEach(p => mark(series, p.x, p.y, group));
      seen.push(...points.filter(p => p.tip));
      return group;
    });
    return { layer, curves, seen };
  }

  // The values at the point next to the pointer, in a box of the figure.
  function showValues(svg, figure, seen, width) {
    const box = figure.querySelector('.values') || figure.appendChild(document.createElement('div'));
    box.className = 'values';
    box.hidden = true;
    const ring = make('circle', { r: 8, style: 'fill:none;stroke:var(--ink);stroke-width:1.5', visibility: 'hidden' }, svg);
    const hide = () => { box.hidden = true; ring.setAttribute('visibility', 'hidden'); };
    const show = event => {
      const place = svg.getBoundingClientRect(), zoom = width / place.width;
      const x = (event.clientX - place.left) * zoom, y = (event.clientY - place.top) * zoom;
      let next = null, shortest = 26;
      for (const p of seen) {
        const distance = Math.hypot(p.x - x, p.y - y);
        if (distance < shortest) [next, shortest] = [p, distance];
      }
      if (!next) return hide();
      ring.setAttribute('cx', next.x);
      ring.setAttribute('cy', next.y);
      ring.setAttribute('visibility', 'visible');
      box.textContent = next.tip();
      box.hidden = false;
      const frame = figure.getBoundingClientRect(), left = next.x / zoom + place.left - frame.left;
      box.style.left = `${Math.max(0, Math.min(left + 12, frame.width - box.offsetWidth))}px`;
      box.style.top = `${next.y / zoom + place.top - frame.top + 14}px`;
    };
    svg.addEventListener('pointermove', show);
    svg.addEventListener('pointerdown', show);
    svg.addEventListener('pointerleave', hide);
  }

  const drawable = spec => p => Number.isFinite(p.x) && Number.isFinite(p.y) && (!spec.x.log || p.x > 0) && (!spec.y.log || p.y > 0);

  // Where everything goes in a picture of a width: the plot's area, its scales and ticks, the legend.
  function layoutOf(spec, width) {
    const narrow = width < 560, shown = spec.legend === false ? [] : spec.series.filter(s => s.label && s.points.length);
    const beside = width >= 760 && shown.length > 3;
    const keys = shown.length ? arrange(shown, width, beside) : { width: 0, height: 0 };
    const ranges = { x: scale(spec.x, spec.series.flatMap(s => s.points.map(p => p.x))),
      y: scale(spec.y, spec.series.flatMap(s => s.points.map(p => p.y))) };
    const categories = spec.y.categories && spec.y.categories.length;
    if (categories) Object.assign(ranges.y, { low: -0.7, high: categories - 0.3 });
    const rest = width - (beside ? keys.width : 0);
    const tall = categories ? categories * (narrow ? 44 : 32) + 20 : Math.round(Math.min(400, Math.max(240, rest * 0.56)));
    const area = { top: 10, bottom: 10 + tall, left: 0, right: rest - (beside ? 22 : 14) };
    const names = categories && narrow ? [] : ticksOf(spec.y, ranges.y, tall, 30).map(t => widthOf(t.label));
    area.left = Math.ceil(Math.max(0, ...names) + tick + 5 + (spec.y.label ? fontSize + gap + 4 : 2));
    if (spec.equal) equalise(ranges, area);
    const at = scalesOf(ranges, area, categories);
    const y = ticksOf(spec.y, ranges.y, tall, 30), corner = y.some(t => at.y(t.at) > area.bottom - fontSize);
    const from = corner && !categories ? area.left - tick - 3 : 0;  // a label of y stands beside the corner
    const ticks = { x: apart(ticksOf(spec.x, ranges.x, area.right - area.left, 56), at.x, from, width), y };
    const foot = area.bottom + 2 * fontSize + 22;
    return { narrow, shown, beside, keys, ranges, area, at, ticks, foot,
      height: beside ? Math.max(foot, keys.height + 20) : foot + keys.height };
  }

  function scalesOf(ranges, area, categories) {
    const place = (range, from, to) => value => from + (value - range.low) / (range.high - range.low) * (to - from);
    const [from, to] = categories ? [area.top, area.bottom] : [area.bottom, area.top];
    return { x: place(ranges.x, area.left, area.right), y: place(ranges.y, from, to) };
  }

  function plot(figure, given) {
    const spec = { ...given, series: given.series.map(s => ({ ...s, points: s.points.filter(drawable(given)) })) };
    const width = Math.max(280, Math.floor(figure.clientWidth)), layout = layoutOf(spec, width);
    const { area, at, ranges, beside } = layout, height = layout.height;
    const svg = make('svg', { class: 'picture', width, height, viewBox: `0 0 ${width} ${height}`, role: 'img',
      'aria-label': spec.description || spec.name, 'font-size': fontSize, 'font-family': font });
    drawAxes(svg, spec, area, at, layout.ticks, layout.narrow);
    const { layer, curves, seen } = drawCurves(svg, spec, at, area, ranges);
    svg.append(...svg.querySelectorAll('.tick'));  // names of categories lie on the curves where there is little room
    if (layout.shown.length)
      legend(svg, layout.shown, layout.keys, beside ? area.right + 20 : Math.min(area.left, 10),
        beside ? area.top : layout.foot + 4, layout.shown.map(s => curves[spec.series.indexOf(s)]));
    figure.querySelectorAll(':scope > svg, :scope > img').forEach(old => old.remove());
    figure.querySelector('figcaption').after(svg);
    showValues(svg, figure, seen, width);
    return { svg, layer, x: v => at.x(ranges.x.place(v)), y: v => at.y(ranges.y.place(v)) };
  }

  // One unit is as long across as upwards: the shorter side is given more room.
  function equalise(ranges, area) {
    const perX = (ranges.x.high - ranges.x.low) / (area.right - area.left);
    const perY = (ranges.y.high - ranges.y.low) / (area.bottom - area.top);
    const [range, factor] = perX < perY ? [ranges.x, perY / perX] : [ranges.y, perX / perY];
    const middle = (range.low + range.high) / 2, half = (range.high - range.low) / 2 * factor;
    [range.low, range.high] = [middle - half, middle + half];
  }

  return Object.assign(plot, { make, extent });
})();
