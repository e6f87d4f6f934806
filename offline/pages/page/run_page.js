// The page of runs: plan, command, measurement and truth of one run or several on one axis of time.

const data = JSON.parse(byId('data').textContent);
const scene = data.scene;
const runs = data.runs;
const several = runs.length > 1;
const kinds = ['plan', 'command', 'measured', 'truth'];
const kindNames = {plan: 'plan', command: 'command', measured: 'measured', truth: 'truth'};
const eventsMax = 500;  // of each run
const marksMax = 80;  // in a plot

// The events that are shown: where there are very many, those that matter most.
const eventRank = {fault: 0, refusal: 1, timing: 2, request: 3, truth: 4, state: 5};
const byTime = (a, b) => a.time_s - b.time_s;
const foremost = (events, most) => (events.length <= most ? events
  : [...events].sort((a, b) => eventRank[a.kind] - eventRank[b.kind] || byTime(a, b)).slice(0, most).sort(byTime));

// What is said again and again without a pause, up to the numbers in it, is one event that counts them.
const foldGap = 0.05;  // s
function folded(events) {
  const open = new Map();
  const list = [];
  for (const event of [...events].sort(byTime)) {
    const what = `${event.kind} ${event.text.replace(/[\d.\u2212+-]+/g, '#')}`;
    const before = open.get(what);
    if (['refusal', 'timing', 'request'].includes(event.kind) && before && event.time_s - before.until_s <= foldGap) {
      before.count += 1;
      before.until_s = event.time_s;
      continue;
    }
    const own = {...event, count: 1, until_s: event.time_s};
    open.set(what, own);
    list.push(own);
  }
  for (const event of list) {
    if (event.count > 1) event.text += ` (${event.count} times, until ${fixed(event.until_s, 3)} s)`;
  }
  return list;
}

runs.forEach((run, r) => {
  run.events = folded(run.events);
  run.left = Math.max(0, run.events.length - eventsMax);
  run.events = foremost(run.events, eventsMax);
  run.label = String.fromCharCode(65 + r);
  const base = run.name.split('/').pop();
  run.short = runs.filter((other) => other.name.split('/').pop() === base).length > 1 ? run.name : base;
  run.style = `run-${r}`;
});

// A robot's motion with the links that it moves.
function motionOf(robot) {
  return new Motion({...robot, ...scene, duration_s: robot.times_s[robot.times_s.length - 1],
    forces: robot.times_s.map(() => []), links: scene.links.map((link, k) => ({...link, ...robot.links[k]}))});
}

// The last index whose time is not after t; -1 before the first, and past the last.
function indexAt(times, t) {
  if (times.length === 0 || t < times[0] || t > times[times.length - 1] + 1e-9) return -1;
  let low = 0;
  let high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle;
  }
  return low;
}

// The text at or before t.
const textAt = (times, column, t) => {
  const i = indexAt(times, t);
  return i < 0 ? null : column[i];
};
// The value at t, between two samples on the line that the plot draws; none where it has none.
const at = (times, column, t) => {
  const i = indexAt(times, t);
  if (i < 0) return null;
  if (t <= times[i] || i + 1 >= times.length) return column[i];
  if (column[i] === null || column[i + 1] === null) return null;
  return column[i] + ((t - times[i]) / (times[i + 1] - times[i])) * (column[i + 1] - column[i]);
};

// One time for all: from the earliest to the latest of any run.
const spans = runs.flatMap((run) => [run.ticks, run.plan, run.truth]).filter((part) => part && part.times_s.length > 0)
  .map((part) => part.times_s);
const axis = {
  first: Math.min(...spans.map((times) => times[0])),
  last: Math.max(...spans.map((times) => times[times.length - 1])),
  times: spans.reduce((best, times) => (times.length > best.length ? times : best)),
  clamp: (t) => Math.min(Math.max(t, axis.first), axis.last),
  nearest: (t) => Math.max(0, indexAt(axis.times, Math.min(Math.max(t, axis.times[0]), axis.times[axis.times.length - 1]))),
};
let range = [axis.first, axis.last];
let timePlots = [];
let latencyPlots = [];
const robots = runs.flatMap((run, r) => ['truth', 'plan'].filter((kind) => run[kind])
  .map((kind) => ({run, kind, hue: `kind-${kind} run-${r}`, motion: motionOf(run[kind])})));
// The first truth is drawn in full, everything else as outlines over it.
robots.sort((a, b) => (a.kind === b.kind ? 0 : a.kind === 'truth' ? -1 : 1));
const stage = robots.length > 0 ? new Stage(byId('stage'), robots[0].motion, 0, robots.slice(1)) : null;

// Header, legend and the figures beside the stage.

function fillHeader() {
  byId('title').textContent = runs.map((run) => run.short).join(several ? ' · ' : '');
  const fact = (run, name) => (run.facts.find(([n]) => n === name) || ['', ''])[1];
  const thinned = runs.filter((run) => run.ticks && run.ticks.times_s.length < run.tick_count);
  byId('sampling').textContent = thinned.length === 0 ? '' : `; shown: ${thinned.map((run) => `${several ? `${run.label}: ` : ''}${run.ticks.times_s.length} of ${run.tick_count} ticks`).join(', ')}`;
  for (const run of runs) {
    element('div', {}, byId('subtitle'), `${several ? `${run.label}: ${run.name}, ` : ''}${fact(run, 'motion')}, ${fact(run, 'outcome')}`);
  }
  const legend = byId('legend');
  robots.forEach((robot, k) => {
    const item = element('li', {class: robot.hue}, legend);
    element('b', {class: `swatch ${k === 0 ? 'solid' : 'outlined'}`}, item);
    element('span', {}, item, `robot, ${robot.kind}${several ? ` of ${robot.run.label}` : ''}`);
  });
  if (!robots.some((robot) => robot.kind === 'truth')) {
    element('li', {}, legend, 'Where the robot really was is not known here.');
  }
}

function columnOf(run, kind, joint, key) {
  if (kind === 'truth') return run.truth && [run.truth.times_s, run.truth.joints[joint][key]];
  if (run.ticks) return [run.ticks.times_s, run.ticks.joints[joint][kind][key]];
  return kind === 'plan' && run.plan ? [run.plan.times_s, run.plan.joints[joint][key]] : null;
}

let figureCells = [];

function fillFigures() {
  for (const [r, run] of runs.entries()) {
    const own = kinds.filter((kind) => columnOf(run, kind, 0, 'position_rad'));
    const table = element('table', {class: `figures run-${r}`}, byId('figures'));
    const head = element('tr', {}, element('thead', {}, table));
    element('th', {}, head, several ? `${run.label}` : '');
    for (const kind of own) {
      const th = element('th', {class: `kind-${kind} run-${r}`}, head);
      element('b', {class: 'swatch line'}, th);
      element('span', {}, th, kindNames[kind]);
    }
    const body = element('tbody', {}, table);
    const row = (name, read) => {
      const tr = element('tr', {}, body);
      element('th', {}, tr, name);
      for (const kind of own) figureCells.push([element('td', {class: `kind-${kind} run-${r}`}, tr), (t) => read(kind, t)]);
    };
    scene.joints.forEach((joint, j) => {
      for (const [key, unit, digits] of [['position_rad', 'rad', 3], ['torque_nm', 'N·m', 2]]) {
        row(`${joint.name} [${unit}]`, (kind, t) => shown(at(...columnOf(run, kind, j, key), t), digits));
      }
    });
    row('pitch [rad]', (kind, t) =>
      (run[kind] ? shown(at(run[kind].times_s, run[kind].root_pitch_rad, t), 3) : ''));
  }
}

function phaseAt(run, t) {
  if (!run.ticks) return t <= (run.bands[0]?.to_s ?? 0) ? run.bands[0]?.name ?? '' : 'held';
  const state = textAt(run.ticks.times_s, run.ticks.states, t);
  const band = run.bands.find((b) => t >= b.from_s && t < b.to_s);
  return state === null ? 'not recorded' : band ? `${state}: ${band.name}` : state;
}

function showPanel(t) {
  byId('time').textContent = `${fixed(t, 3)} s`;
  byId('phase').textContent = runs.map((run) => (several ? `${run.label} ` : '') + phaseAt(run, t)).join(', ');
  for (const [cell, read] of figureCells) cell.textContent = read(t);
}

// Which curves are shown.

function fillToolbar() {
  const without = new Set();
  const toggle = (id, value, hue, name) => {
    const button = element('button', {type: 'button', class: hue, 'aria-pressed': 'true', 'data-value': value}, byId(id));
    element('b', {class: 'swatch line'}, button);
    element('span', {title: name}, button, name);
    button.addEventListener('click', () => {
      if (!without.delete(value)) without.add(value);
      button.setAttribute('aria-pressed', !without.has(value));
      document.documentElement.dataset.without = [...without].join(' ');
    });
  };
  const present = kinds.filter((kind) => runs.some((run) => columnOf(run, kind, 0, 'position_rad')));
  for (const kind of present) toggle('kinds', kind, `kind-${kind}`, kindNames[kind]);
  byId('runs').hidden = !several;
  runs.forEach((run, r) => toggle('runs', `run-${r}`, `kind-${run.recorded ? 'measured' : 'plan'} run-${r}`, `${run.label}: ${run.short}`));
  // A button that hides a run stays visible itself.
  for (const button of document.querySelectorAll('.toolbar button[data-value]')) button.style.display = 'flex';
  byId('zoom').addEventListener('click', (event) => zoomBy(event.target.dataset.value));
}

// Range of time.

function setRange(from, to) {
  const width = Math.min(Math.max(to - from, 0.01), axis.last - axis.first);
  const start = Math.min(Math.max(from, axis.first), axis.last - width);
  range = [start, start + width];
  const whole = width >= axis.last - axis.first - 1e-9;
  const parts = fragment();
  for (const [key, value] of [['from', range[0]], ['to', range[1]]]) {
    if (whole) parts.delete(key);
    else parts.set(key, value.toFixed(3));
  }
  try {
    history.replaceState(null, '', `#${parts}`);
  } catch (error) {
    // Some browsers forbid this on a page from a file; see keepTime.
  }
  for (const plot of timePlots) {
    plot.spec.x = range;
    plot.spec.marks = marksIn(range);
    plot.layout(plot.width);
  }
  timeline.layout(timeline.width);
  seek(state.time);
}

function zoomBy(how, around = state.time) {
  const [from, to] = range;
  const scaled = (factor) => setRange(around - (around - from) * factor, around + (to - around) * factor);
  if (how === 'all') setRange(axis.first, axis.last);
  if (how === 'in') scaled(0.5);
  if (how === 'out') scaled(2);
  if (how === 'node') {
    const bands = runs[0].bands;
    const band = bands.find((b) => state.time >= b.from_s && state.time <= b.to_s) ||
      bands.find((b) => b.from_s >= state.time) || bands[bands.length - 1];
    if (band) setRange(band.from_s - 0.05, band.to_s + 0.05);
  }
}

// What happened, on the axis of time: for each run its nodes and, below, its events with their texts as far as there
// is room; faults first.
class Timeline {
  constructor(parent) {
    this.svg = element('svg', {role: 'img', 'aria-label': 'Nodes, states and events by time'}, parent);
    let dragging = false;
    const time = (event) => {
      const box = this.svg.getBoundingClientRect();
      const share = ((event.clientX - box.left) * (this.width / box.width) - this.left) / (this.right - this.left);
      return range[0] + Math.min(Math.max(share, 0), 1) * (range[1] - range[0]);
    };
    this.svg.addEventListener('pointerdown', (event) => { dragging = true; pause(); seek(time(event)); });
    this.svg.addEventListener('pointermove', (event) => { if (dragging) seek(time(event)); });
    for (const end of ['pointerup', 'pointerleave', 'pointercancel']) this.svg.addEventListener(end, () => { dragging = false; });
  }

  layout(width) {
    this.width = width;
    this.left = 48;
    this.right = width - 10;
    const px = this.px = (t) => this.left + ((t - range[0]) / (range[1] - range[0])) * (this.right - this.left);
    const {svg} = this;
    svg.replaceChildren();
    let y = 4;
    runs.forEach((run, r) => {
      const row = element('g', {class: `run-${r}`}, svg);
      const clip = `timeline-clip-${r}`;
      element('rect', {x: this.left, y, width: this.right - this.left, height: 400},
        element('clipPath', {id: clip}, element('defs', {}, row)));
      element('rect', {class: 'row', x: this.left, y, width: this.right - this.left, height: 20}, row);
      if (several) element('text', {class: 'run-label', x: this.left / 2, y: y + 14}, row, run.label);
      const bands = element('g', {'clip-path': `url(#${clip})`}, row);
      for (const band of run.bands) {
        const [from, to] = [Math.max(px(band.from_s), this.left), Math.min(px(band.to_s), this.right)];
        if (to <= from) continue;
        const rect = element('rect', {class: `band band-${band.node % 8}`, x: from, y, width: to - from, height: 20}, bands);
        element('title', {}, rect, `${band.name}, ${fixed(band.from_s, 3)} … ${fixed(band.to_s, 3)} s`);
        if (6.2 * band.name.length < to - from - 8) element('text', {class: 'band-label', x: from + 5, y: y + 14}, bands, band.name);
      }
      y = this.layoutEvents(run, row, y) + 10;
    });
    this.cursor = element('line', {class: 'cursor', y1: 2, y2: y - 8}, svg);
    svg.setAttribute('viewBox', `0 0 ${width} ${y}`);
  }

  layoutEvents(run, row, y) {
    const lanes = [];
    const placed = [];
    const own = foremost(run.events.filter((e) => e.time_s >= range[0] && e.time_s <= range[1]), marksMax);
    for (const event of [...own].sort((a, b) => eventRank[a.kind] - eventRank[b.kind] || byTime(a, b))) {
      const x = this.px(event.time_s);
      const text = event.text.length > 120 ? `${event.text.slice(0, 118)}…` : event.text;
      const wide = 5.9 * text.length + 8;
      const left = x + wide > this.right ? x - wide : x;
      let lane = 0;
      while (lane < 5 && (lanes[lane] || []).some(([a, b]) => left < b && left + wide > a)) ++lane;
      const room = lane < 5 && left >= this.left - 4;
      if (room) (lanes[lane] = lanes[lane] || []).push([left, left + wide]);
      placed.push({event, x, lane: room ? lane : null, left: left < x, text});
    }
    const bottom = y + 24 + 13 * lanes.length;
    for (const {event, x, lane, left, text} of placed) {
      const line = element('line', {class: `event event-${event.kind}`, x1: x, x2: x, y1: y, y2: lane === null ? y + 24 : y + 34 + 13 * lane}, row);
      element('title', {}, line, `${fixed(event.time_s, 3)} s: ${event.text}`);
      if (lane === null) continue;
      const label = element('text', {class: `event-label event-${event.kind}`, x: left ? x - 4 : x + 4, y: y + 33 + 13 * lane,
        'text-anchor': left ? 'end' : 'start'}, row, text);
      element('title', {}, label, `${fixed(event.time_s, 3)} s: ${event.text}`);
    }
    return bottom;
  }

  show(t) {
    const visible = t >= range[0] && t <= range[1];
    this.cursor.style.display = visible ? '' : 'none';
    this.cursor.setAttribute('x1', this.px(t));
    this.cursor.setAttribute('x2', this.px(t));
  }
}

const timeline = new Timeline(byId('timeline'));

// Plots over time.

const allEvents = runs.flatMap((run) => run.events.map((event) => ({...event, run})));
const marksIn = ([from, to]) => foremost(allEvents.filter((e) => e.time_s >= from && e.time_s <= to), marksMax)
  .map((e) => ({x: e.time_s, hue: `event-${e.kind} ${e.run.style}`, text: e.text}));

function addTimePlot(host, title, unit, yTicks, digits, curves, limits = [], least = null) {
  if (curves.length === 0) return;
  const {y, hidden} = rangeWithLimits(curves.map((c) => c.ys), limits.map((l) => l.value));
  if (least !== null) y.splice(0, 2, least, Math.max(y[1], least + 2));
  const nearby = (t) => allEvents.find((e) => Math.abs(e.time_s - t) < 0.004 * (range[1] - range[0]));
  timePlots.push(new Plot(host, {
    title, unit, yTicks, y, limits,
    x: range, xLabel: 'time [s]', xTicks: niceTicks,
    bands: runs[0].bands.map((b) => ({from: b.from_s, to: b.to_s, hue: `band-${b.node % 8}`, label: b.name})),
    marks: marksIn(range),
    note: hidden ? `limits lie outside: ${limits.map((l) => l.label.replace('limit ', '')).join(', ')}` : '',
    curves: curves.map((c) => ({...c, kind: 'line', value: (t) => at(c.xs, c.ys, t), read: (t) => shown(at(c.xs, c.ys, t), digits)})),
    flag: (t) => `${fixed(t, 3)} s${nearby(t) ? `: ${nearby(t).text}` : ''}`,
    onHover: (t) => { state.hover = t; showPlots(); },
    onSeek: (t) => { pause(); seek(t); },
  }));
}

function fillTimePlots() {
  const label = (kind, run) => kindNames[kind] + (several ? ` ${run.label}` : '');
  scene.joints.forEach((joint, j) => {
    const heading = element('h3', {}, byId('joint-plots'), joint.name);
    element('small', {}, heading, 'joint');
    const host = element('div', {class: 'plots'}, byId('joint-plots'));
    const curvesOf = (key) => kinds.flatMap((kind) => runs.flatMap((run, r) => {
      const column = columnOf(run, kind, j, key);
      return column ? [{name: label(kind, run), hue: `kind-${kind} run-${r}`, xs: column[0], ys: column[1]}] : [];
    }));
    const ofTicks = (key) => runs.flatMap((run, r) => (run.ticks ? [{name: several ? run.label : '', hue: `kind-measured run-${r}`,
      xs: run.ticks.times_s, ys: run.ticks.joints[j][key]}] : []));
    const limit = (value, digits) => ({value, hue: 'hue-limit', label: `limit ${fixed(value, digits)}`});
    addTimePlot(host, 'Position', 'rad', angleTicks, 4, curvesOf('position_rad'), (joint.position_limits_rad || []).map((v) => limit(v, 2)));
    addTimePlot(host, 'Velocity', 'rad/s', niceTicks, 2, curvesOf('velocity_rad_s'));
    addTimePlot(host, 'Torque', 'N·m', niceTicks, 2, curvesOf('torque_nm'),
        joint.torque_limit_nm === null ? [] : [limit(joint.torque_limit_nm, 1), limit(-joint.torque_limit_nm, 1)]);
    addTimePlot(host, 'Following error', 'rad', niceTicks, 5, ofTicks('following_error_rad'));
    addTimePlot(host, 'Age of the reply', 'ticks', niceTicks, 0, ofTicks('reply_age_ticks'), [], 0);
  });
  const rootCurves = (read) => ['plan', 'truth'].flatMap((kind) => runs.flatMap((run, r) => (run[kind]
    ? [{name: label(kind, run), hue: `kind-${kind} run-${r}`, xs: run[kind].times_s, ys: read(run[kind])}] : [])));
  const root = byId('root-plots');
  const heading = element('h3', {}, null, scene.links[0].name);
  element('small', {}, heading, 'root');
  root.before(heading);
  addTimePlot(root, 'Root pitch', 'rad', angleTicks, 3, rootCurves((robot) => robot.root_pitch_rad));
  // A root that stays where it is has no more to show.
  const moves = (column) => column.some((v) => Math.abs(v - column[0]) > 1e-6);
  for (const [title, key] of [['Root height', 'z_m'], ['Root along x', 'x_m']]) {
    if (runs.some((run) => ['plan', 'truth'].some((kind) => run[kind] && moves(run[kind].links[0][key]))))
      addTimePlot(root, title, 'm', niceTicks, 3, rootCurves((robot) => robot.links[0][key]));
  }
  // No drive measures a joint without a motor.
  const passive = [...new Set(runs.flatMap((run) => ['plan', 'truth'].flatMap((kind) =>
    ((run[kind] && run[kind].passive) || []).map((joint) => joint.name))))];
  for (const name of passive) {
    const own = element('h3', {}, byId('joint-plots'), name);
    element('small', {}, own, 'joint without a motor');
    const host = element('div', {class: 'plots'}, byId('joint-plots'));
    addTimePlot(host, 'Position', 'rad', angleTicks, 4, ['plan', 'truth'].flatMap((kind) => runs.flatMap((run, r) => {
      const joint = ((run[kind] && run[kind].passive) || []).find((j) => j.name === name);
      return joint ? [{name: label(kind, run), hue: `kind-${kind} run-${r}`, xs: run[kind].times_s, ys: joint.position_rad}] : [];
    })));
  }
  for (const plot of timePlots) {
    plot.svg.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const box = plot.svg.getBoundingClientRect();
      const share = (((event.clientX - box.left) * plot.width) / box.width - plot.left) / (plot.right - plot.left);
      zoomBy(event.deltaY < 0 ? 'in' : 'out', range[0] + share * (range[1] - range[0]));
    }, {passive: false});
  }
}

// Latencies: for each kind one picture with all runs.

function fillLatencies() {
  const names = [...new Set(runs.flatMap((run) => run.latencies.map((l) => l.name)))];
  byId('latencies').hidden = names.length === 0;
  for (const name of names) {
    const own = runs.flatMap((run, r) => run.latencies.filter((l) => l.name === name).map((latency) => ({run, r, latency})));
    const decade = (bin, latency) => bin / latency.bins_per_decade;
    const curves = own.map(({run, r, latency}) => {
      // The curve is one of steps. Counts are shown as logarithms, and the axis begins at a half.
      const floor = Math.log10(0.5);
      const [xs, ys] = [[], []];
      let end = null;
      for (const [bin, count] of latency.bins) {
        if (end !== null && end !== bin) { xs.push(decade(end, latency), decade(bin, latency)); ys.push(floor, floor); }
        xs.push(decade(bin, latency), decade(bin + 1, latency));
        ys.push(Math.log10(count), Math.log10(count));
        end = bin + 1;
      }
      xs.unshift(xs[0]); ys.unshift(floor); xs.push(xs[xs.length - 1]); ys.push(floor);
      return {name: several ? run.label : '', hue: `kind-measured run-${r}`, kind: 'area', xs, ys,
        read: (x) => (x === null ? '' : String((latency.bins.find(([bin]) => bin === Math.floor(x * latency.bins_per_decade + 1e-9)) || [0, 0])[1]))};
    });
    const most = Math.max(...curves.flatMap((c) => c.ys));
    const low = Math.min(...curves.map((c) => c.xs[0]));
    const high = Math.max(...curves.map((c) => c.xs[c.xs.length - 1]));
    const from = Math.floor(low - 0.05);
    const to = Math.max(from + 1, Math.ceil(high + 0.05));
    const host = element('div', {}, byId('latency-plots'));
    const duration = (x) => (x < 3 ? `${significantShort(10 ** x)} µs` : `${significantShort(10 ** (x - 3))} ms`);
    latencyPlots.push(new Plot(host, {
      title: `${name[0].toUpperCase()}${name.slice(1)}`, unit: 'count', curves, log: true,
      y: [Math.log10(0.5), Math.max(1, most + 0.15)], yTicks: (a, b, n) => decadeTicks(Math.max(0, a), b, n),
      x: [from - 0.06 * (to - from), to + 0.06 * (to - from)], xLabel: 'duration, from 1 µs on',
      xTicks: (a, b) => Array.from({length: Math.floor(b) - Math.ceil(a) + 1}, (_, k) => ({value: Math.ceil(a) + k, label: duration(Math.ceil(a) + k)})),
      marks: own.flatMap(({r, latency}) => latency.percentiles_us.filter(([p]) => p !== 'max')
        .map(([p, us]) => ({x: Math.log10(Math.max(us, 1)), hue: `event-request run-${r}`, text: `${p}: ${us} µs`}))),
      flag: duration,
      onHover: (x) => latencyPlots.forEach((plot) => plot.show(null, plot === latencyPlots.hovered ? x : null)),
    }));
    const plot = latencyPlots[latencyPlots.length - 1];
    plot.svg.addEventListener('pointerenter', () => { latencyPlots.hovered = plot; });
    element('p', {class: 'plot-note'}, host, own[0].latency.meaning);
    const table = element('table', {class: 'percentiles'}, host);
    const head = element('tr', {}, table);
    for (const text of ['', 'count', ...own[0].latency.percentiles_us.map(([p]) => p)]) element('th', {}, head, text);
    for (const {run, latency} of own) {
      const tr = element('tr', {}, table);
      element('th', {}, tr, several ? run.label : '');
      element('td', {}, tr, String(latency.count));
      for (const [, us] of latency.percentiles_us) element('td', {}, tr, us === 0 ? '0' : us < 1000 ? `${significantShort(us)} µs` : `${significantShort(us / 1000)} ms`);
    }
  }
}

// Three significant digits.
function significantShort(value) {
  if (value === 0) return '0';
  return String(Number(value.toPrecision(3)));
}

// Tables.

function fillTables() {
  const cellsOf = (parent, texts, tag = 'td') => texts.map((text) => element(tag, {}, parent, text));
  const differences = byId('differences');
  differences.hidden = !several;
  byId('differences-note').textContent = data.differences.length === 0
    ? 'only records of the same rate can be compared tick by tick'
    : `run less ${runs[0].label} (${runs[0].short}), at the same tick since the motion began`;
  differences.querySelector('table').hidden = data.differences.length === 0;
  for (const d of data.differences) {
    cellsOf(element('tr', {}, differences.querySelector('tbody')), [runs[d.run].label, d.joint, d.quantity,
      d.ticks === 0 ? 'not measured' : d.max === 0 ? 'none' : `${significant(d.max)} ${d.unit}`, d.max === 0 ? '' : `${fixed(d.max_at_s, 3)} s`,
      d.max === 0 ? '' : `${significant(d.rms)} ${d.unit}`, String(d.ticks)]);
  }

  const list = [...allEvents].sort(byTime);
  byId('events').hidden = list.length === 0;
  for (const event of list) {
    const tr = element('tr', {class: `event-${event.kind} ${event.run.style}`}, byId('events').querySelector('tbody'));
    cellsOf(tr, [`${fixed(event.time_s, 3)} s`, event.run.label, event.kind, event.text]);
    tr.addEventListener('click', () => {
      pause();
      if (event.time_s < range[0] || event.time_s > range[1]) setRange(event.time_s - (range[1] - range[0]) / 2, event.time_s + (range[1] - range[0]) / 2);
      seek(event.time_s);
    });
  }
  const left = runs.reduce((sum, run) => sum + run.left, 0);
  byId('events-note').textContent = left > 0 ? `${left} more are not shown: at most ${eventsMax} of each run are, faults first and transitions last.` : '';

  const facts = byId('facts-of-runs').querySelector('table');
  if (several) cellsOf(element('tr', {}, facts.tHead), ['', ...runs.map((run) => `${run.label}: ${run.short}`)], 'th');
  const names = [...new Set(runs.flatMap((run) => run.facts.map(([name]) => name)))];
  for (const name of names) {
    const tr = element('tr', {}, facts.tBodies[0]);
    element('th', {scope: 'row'}, tr, name);
    cellsOf(tr, runs.map((run) => run.facts.filter(([n]) => n === name).map(([, value]) => value).join('; ') || '–'));
  }
}

// One time for all.

function showPlots() {
  for (const plot of timePlots) plot.show(state.time, state.hover);
}

function showTime(t) {
  if (stage) stage.draw(robots[0].motion.clamp(t), t);
  showPanel(t);
  showPlots();
  timeline.show(t);
}

function layout(event) {
  const paper = event?.type === 'beforeprint';
  const large = document.documentElement.dataset.view === 'robot';
  const box = byId('stage').parentElement.getBoundingClientRect();
  if (stage && paper && !large) stage.layout(400, 300, false);
  else if (stage && box.width > 0) stage.layout(box.width, box.height, large);
  for (const plot of [...timePlots, ...latencyPlots]) {
    const width = plot.figure.getBoundingClientRect().width;
    if (paper) plot.layout(250, 165);  // three in a row
    else plot.layout(width > 0 ? width : 480);
  }
  const width = byId('timeline').getBoundingClientRect().width;
  timeline.layout(paper ? 700 : width > 0 ? width : 900);
  for (const plot of latencyPlots) plot.show(null, null);
  seek(state.time);
}

// The address: t, a time in s; from, to, the range of the plots; view=robot, the robot alone; camera=fit or follow;
// theme=light or dark.
function applyFragment() {
  const parts = fragment();
  document.documentElement.dataset.view = parts.get('view') === 'robot' ? 'robot' : 'page';
  applyTheme();
  if (stage && ['fit', 'follow'].includes(parts.get('camera'))) stage.camera = parts.get('camera');
  if (stage) choose('camera', stage.camera);
  takeTime(parts);
  layout();
  const [from, to] = [parseFloat(parts.get('from')), parseFloat(parts.get('to'))];
  if (Number.isFinite(from) && Number.isFinite(to) && to > from) setRange(from, to);
}

function listen() {
  byId('slider').style.setProperty('--motion', '100%');
  byId('camera').addEventListener('click', (event) => {
    if (!event.target.dataset.value || !stage) return;
    stage.camera = event.target.dataset.value;
    choose('camera', stage.camera);
    layout();
  });
  window.addEventListener('hashchange', applyFragment);
  for (const cause of ['resize', 'beforeprint', 'afterprint']) window.addEventListener(cause, layout);
}

startPlayer(axis, showTime);
state.time = axis.clamp(0);
fillHeader();
fillFigures();
fillToolbar();
fillTimePlots();
fillLatencies();
fillTables();
listen();
applyFragment();
document.documentElement.dataset.ready = 'true';
