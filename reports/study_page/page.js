// What the page of a study draws and does: its pictures from the data it holds, tables that sort, files to save.
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const largestDrawn = 10;  // errors above it show no trend

const number = (value, digits = 3) => value === null || value === undefined ? '–' : Number(value.toPrecision(digits)).toString();
const exponent = value => value === null ? '–' : value.toExponential(1).replace('-', '−');
function seconds(value) {
  if (value === null) return '–';
  if (value < 1e-3) return `${number(value * 1e6)} µs`;
  return value < 1 ? `${number(value * 1e3)} ms` : `${number(value)} s`;
}

const ida = { method: 'ida', label: 'IDA', colour: 'var(--baseline-ida)', marker: 1, hollow: true };
const erk = { method: 'erk', label: 'explicit', colour: 'var(--baseline-erk)', marker: 2, hollow: true, dash: '6,4' };
const styles = data.styles.map(style => ({ ...style, colour: `var(--series-${style.colour % 6})`,
  dash: ['', '9,4', '2,3', '9,3,2,3'][style.marker % 4], hollow: style.marker % 12 >= 6 }));

const errorOf = row => row.error_q === null || row.error_p === null ? NaN : Math.max(row.error_q, row.error_p);
const rowsOf = (study, style) => study.rows.filter(row => row.status === 'ok' && row.method === style.method &&
  row.order === style.order && (style.formulation === undefined || row.formulation === style.formulation) && errorOf(row) <= largestDrawn &&
  errorOf(row) > (study.reference.self_error || 0));

// IDA has a curve for each formulation it runs in.
function baselines(study) {
  const formulations = [...new Set(study.rows.filter(row => row.method === 'ida').map(row => row.formulation))];
  return [...formulations.map((formulation, i) => ({ ...ida, formulation, label: `IDA, ${formulation}`, dash: ['', '9,5', '2,4'][i % 3] })), erk];
}

function rowTip(row, style) {
  const rate = row.step === undefined ? `${row.formulation ? `${row.formulation}, ` : ''}rtol ${row.rtol}` : `step ${number(row.step, 4)}`;
  return () => [style.label, `${rate}, ${row.steps} steps`, `error of q ${exponent(row.error_q)}, of p ${exponent(row.error_p)}`,
    `CPU ${seconds(row.cpu_seconds.median)} (${seconds(row.cpu_seconds.min)} to ${seconds(row.cpu_seconds.max)})`,
    `rows violated by ${exponent(row.constraint)}`].join('\n');
}

const series = (study, list, x) => list.map(style => ({ ...style,
  points: rowsOf(study, style).map(row => ({ x: x(row), y: errorOf(row), tip: rowTip(row, style) })) }));
const timeLabel = history => history && history.time_unit ? `time [${history.time_unit}]` : "time [the scene's unit]";
const overTime = (history, label, values, k, extra = {}) => ({ label, colour: `var(--series-${k % 6})`, ...extra,
  points: history.time.map((t, i) => ({ x: t, y: values[i], tip: () => `${label}\nt = ${t}\n${exponent(values[i])}` })) });

const pictures = {
  work: study => ({ x: { label: 'CPU time [s]', log: true }, y: { label: 'relative error of q and p at the end [1]', log: true },
    series: series(study, [...styles, ...baselines(study)], row => row.cpu_seconds.median) }),
  orders: (study, history) => ({
    x: { label: history && history.time_unit ? `step [${history.time_unit}]` : "step [the scene's unit of time]", log: true },
    y: { label: 'relative error of q and p at the end [1]', log: true },
    series: series(study, styles, row => Math.abs(row.step)).map(s => {
      const order = study.measured_order.find(m => m.method === s.method && m.order === s.order);
      return { ...s, label: order && order.slope !== null ? `${s.label}: ${order.slope.toFixed(2)}` : s.label };
    }) }),
  error: (study, history) => ({ x: { label: timeLabel(history), log: true }, y: { label: 'error over largest q, p [1]', log: true },
    legend: false, series: [overTime({ ...history, time: history.time.map(t => Math.abs(t - study.t_start)) }, 'error', history.error, 0,
      { colour: styles.find(s => s.method === history.method).colour })] }),
  history: (study, history) => ({ x: { label: timeLabel(history) },
    y: { label: 'relative change, or violation [1]', log: true },
    series: [['total energy', history.energy], ['rows', history.constraint], ...history.invariants.map(i => [i.name, i.values])]
      .filter(([, values]) => values.length)
      .map(([label, values], k) => overTime(history, label, values.map(v => v === null ? v : Math.max(v, 1e-18)), k)) }),
};

let summaryError = 1e-6;
function summarySpec() {
  const categories = data.studies.map(study => study.scene);
  const best = study => study.at_error.find(at => at.best && at.error === summaryError);
  const points = (style, key) => ({ ...style, line: false, size: 5, points: data.studies.flatMap((study, i) => {
    const at = best(study), ratio = at && at[key];
    return ratio ? [{ x: ratio, y: i, tip: () => `${study.scene}\n${style.label} / ours: ${ratio.toFixed(2)}\n` +
      `ours: ${at.method}, order ${at.order}` }] : [];
  }) });
  const series = [points(ida, 'ratio'), points(erk, 'erk_ratio')];
  const one = { label: '', colour: 'var(--ink)', width: 1.4, points: [-0.7, categories.length - 0.3].map(y => ({ x: 1, y })) };
  return { x: { label: 'time of the baseline / time of ours [1]', log: true, plain: true, include: [0.5, 2] }, y: { categories },
    series: [one, ...series] };
}

// The file of a picture: colours are written out, since it will stand without the style sheet.
function svgText(svg) {
  const colours = getComputedStyle(document.documentElement), copy = svg.cloneNode(true);
  copy.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
  copy.insertBefore(Plot.make('rect', { width: '100%', height: '100%', style: 'fill:var(--paper)' }), copy.firstChild);
  return new XMLSerializer().serializeToString(copy)
    .replace(/var\((--[\w-]+)\)/g, (_, name) => colours.getPropertyValue(name).trim());
}

function save(name, type, content) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function savePng(svg, name) {
  const image = new Image(), scale = 2;
  image.onload = () => {
    const canvas = Object.assign(document.createElement('canvas'), { width: scale * svg.width.baseVal.value,
      height: scale * svg.height.baseVal.value });
    canvas.getContext('2d').drawImage(image, 0, 0, canvas.width, canvas.height);
    canvas.toBlob(blob => save(name, 'image/png', blob));
  };
  image.src = 'data:image/svg+xml;charset=utf-8,' + encodeURIComponent(svgText(svg));
}

function csvText(studies) {
  const field = value => value === null || value === undefined ? '' : /[",\n]/.test(value) ? `"${value.replace(/"/g, '""')}"` : value;
  const keys = ['method', 'order', 'momentum', 'step', 'rtol', 'status', 'error_q', 'error_p', 'self_error', 'constraint',
    'energy_error'], counts = ['steps', 'newton_iterations', 'residual_evaluations', 'jacobian_evaluations', 'formulation'];
  const times = ['median', 'min', 'max', 'repeats'];
  const lines = studies.flatMap(study => study.rows.map(row => [study.scene, ...keys.map(key => row[key]),
    ...times.map(key => row.cpu_seconds[key]), ...counts.map(key => row[key])].map(field).join(',')));
  return [['scene', ...keys, ...times.map(key => `cpu_seconds_${key}`), ...counts].join(','), ...lines, ''].join('\n');
}

function toolButton(bar, label, action) {
  const button = Object.assign(document.createElement('button'), { type: 'button', textContent: label });
  button.addEventListener('click', action);
  bar.append(button);
  return button;
}

function addTools(figure, name) {
  const bar = figure.querySelector('.tools');
  const svg = toolButton(bar, 'SVG', () => save(`${name}.svg`, 'image/svg+xml', svgText(figure.querySelector('svg'))));
  toolButton(bar, 'PNG', () => figure.bodyView ? figure.bodyView.canvas.toBlob(blob => save(`${name}.png`, 'image/png', blob))
    : savePng(figure.querySelector('svg'), `${name}.png`));
  svg.dataset.file = 'svg';
}

function addLevels(figure, draw) {
  const bar = figure.querySelector('.tools'), buttons = [1e-3, 1e-6, 1e-9].map(error => {
    const button = toolButton(bar, `at ${error.toExponential().replace('-', '−')}`, () => {
      summaryError = error;
      buttons.forEach(b => b.setAttribute('aria-pressed', b === button));
      draw();
    });
    button.setAttribute('aria-pressed', error === summaryError);
    return button;
  });
}

function drawing(figure) {
  const kind = figure.dataset.plot;
  if (kind === 'summary') {
    const draw = () => Plot(figure, { name: 'summary', description: figure.dataset.description, ...summarySpec() });
    addLevels(figure, draw);
    addTools(figure, 'summary');
    return draw;
  }
  const study = data.studies[figure.dataset.scene], history = data.histories[figure.dataset.scene];
  const name = `${study.scene}-${kind}`.replace(/[^\w.-]/g, '_');
  const about = { name, description: figure.dataset.description };
  addTools(figure, name);
  if (kind === 'motion')
    return motionPicture(figure, { ...history.motion, timeLabel: timeLabel(history) }, about);
  return () => Plot(figure, { ...about, ...pictures[kind](study, history) });
}

// Each picture is drawn when it comes near the window, and again when its width changes.
const drawings = new Map([...document.querySelectorAll('figure[data-plot]')].map(figure => [figure, drawing(figure)]));
const widths = new Map();
function redraw(figure) {
  if (widths.get(figure) === figure.clientWidth) return;
  widths.set(figure, figure.clientWidth);
  drawings.get(figure)();
}
const resized = new ResizeObserver(entries => entries.forEach(entry => redraw(entry.target)));
drawings.forEach((_, figure) => { redraw(figure); resized.observe(figure); });

// On paper all is open, and the pictures are as wide as it is, so that their letters keep their size.
const openBeforePrint = new Set();
function paper(on) {
  document.body.classList.toggle('paper', on);
  drawings.forEach((_, figure) => redraw(figure));
}
window.addEventListener('beforeprint', () => {
  document.querySelectorAll('details:not([open])').forEach(details => {
    openBeforePrint.add(details);
    details.open = true;
  });
  paper(true);
});
window.addEventListener('afterprint', () => {
  openBeforePrint.forEach(details => { details.open = false; });
  openBeforePrint.clear();
  paper(false);
});

function sortBy(header) {
  const table = header.closest('table'), body = table.tBodies[0], headers = [...header.parentNode.children];
  const rising = header.getAttribute('aria-sort') !== 'ascending', column = headers.indexOf(header);
  headers.forEach(other => other.removeAttribute('aria-sort'));
  header.setAttribute('aria-sort', rising ? 'ascending' : 'descending');
  const key = row => { const { value } = row.cells[column].dataset, text = row.cells[column].textContent;
    return value === undefined ? text : value === '' ? null : Number(value); };
  const order = (a, b) => (typeof a === 'string' ? a.localeCompare(b, 'en', { numeric: true }) : a - b) * (rising ? 1 : -1);
  [...body.rows].map(row => [key(row), row])
    .sort(([a], [b]) => a === null || b === null ? (a === null) - (b === null) : order(a, b))
    .forEach(([, row]) => body.append(row));
}
document.querySelectorAll('th button').forEach(button => button.addEventListener('click', () => sortBy(button.closest('th'))));

document.querySelectorAll('[data-save]').forEach(bar => {
  toolButton(bar, 'all rows as CSV', () => save('study.csv', 'text/csv', csvText(data.studies)));
  toolButton(bar, 'all data as JSON', () => save('study.json', 'application/json',
    JSON.stringify({ studies: data.studies, build: data.build }, null, 2)));
});
