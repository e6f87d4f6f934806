// The page of a motion: one time, shown by the stage, the figures beside it, the slider, the strip and every plot.

const data = JSON.parse(byId('data').textContent);
const motion = new Motion(data);
const stripPoses = 8;
const stage = new Stage(byId('stage'), motion, stripPoses);
let timePlots = [];
let solverPlots = [];
let poseButtons = [];

function maximum(column, key = (v) => v) {
  let best = 0;
  column.forEach((v, i) => { if (key(v) > key(column[best])) best = i; });
  return best;
}

// What the page leaves out where it has nothing to say.
const touches = data.forces.some((list) => list.length > 0);
const travels = [data.links[0].x_m, data.links[0].z_m].some((column) => column.some((v) => Math.abs(v - column[0]) > 1e-6));

// What follows the motion: the settling that the task asks for, and how long the page shows it.
const shownAfter = motion.last - data.duration_s;
const shownLonger = shownAfter > data.settle_s + 1e-9;

function afterwards() {
  if (!motion.settles) return '';
  const shown = `${fixed(shownAfter, 3)} s`;
  if (data.settle_s === 0) return `shown until ${shown} later`;
  return `then ${fixed(data.settle_s, 3)} s of settling${shownLonger ? `; shown until ${shown} later` : ''}`;
}

function phaseAfter(t) {
  if (!motion.settles || t <= data.duration_s) return '';
  return t <= data.duration_s + data.settle_s + 1e-9 ? 'settling' : 'held';
}

// Header.

function fillHeader() {
  byId('title').textContent = data.title;
  byId('subtitle').textContent = data.subtitle;
  const facts = byId('facts');
  const fact = (name, value, unit, more) => {
    const item = element('div', {}, facts);
    element('dt', {}, item, name);
    const dd = element('dd', {}, item, value);
    if (unit) element('i', {}, dd, ` ${unit}`);
    element('p', {}, item, more || '\u00a0');
  };
  fact('Duration', fixed(data.duration_s, 3), 's', afterwards());
  const pitch = motion.value(data.root_pitch_rad, motion.clamp(data.duration_s));
  fact('Root pitch at the end', fixed(pitch, 3), 'rad', `${fixed((pitch * 180) / Math.PI, 1)}°`);
  if (data.joints.length > 0) {
    const peak = data.peak_torque || sampledPeak();
    const worst = data.joints[peak.joint];
    const share = worst.torque_limit_nm === null ? '' : `, ${fixed((100 * peak.torque_nm) / worst.torque_limit_nm, 0)} % of its limit`;
    fact('Peak torque', fixed(peak.torque_nm, 2), 'N·m', `${worst.name} at ${fixed(peak.time_s, 3)} s${share}`);
  }
  if (touches) {
    const i = maximum(motion.normal);
    fact('Peak normal force', fixed(motion.normal[i], 1), 'N', `at ${fixed(motion.times[i], 3)} s`);
  }
  if (data.evaluation_count > 0) {
    const global = data.evaluations.filter((e) => e.global).length;
    const others = data.evaluation_count - data.evaluations.length;
    fact('Evaluations', String(data.evaluation_count), '', `shown: ${global} search, ${data.evaluations.length - global} local solver${others > 0 ? '; the others: of other starts, or failed' : ''}`);
  }
}

// The largest torque at the samples.
function sampledPeak() {
  const peaks = data.joints.map((j) => maximum(j.torque_nm, Math.abs));
  const joint = maximum(peaks.map((i, k) => Math.abs(data.joints[k].torque_nm[i])));
  return {joint, time_s: motion.times[peaks[joint]], torque_nm: Math.abs(data.joints[joint].torque_nm[peaks[joint]])};
}

// The figures beside the stage.

const cells = {};

function fillPanel() {
  const row = (table, hue, name) => {
    const tr = element('tr', {}, byId(table).tBodies[0]);
    const th = element('th', {class: hue}, tr);
    if (hue) element('b', {class: 'swatch'}, th);
    element('span', {}, th, name);
    return [0, 1, 2].map(() => element('td', {}, tr));
  };
  cells.joints = data.joints.map((joint, k) => row('joints', `hue-${k % 8}`, joint.name));
  cells.root = row('root', 'hue-root', data.links[0].name);
  cells.contact = row('contact', 'hue-normal', 'sum');
  byId('joints').hidden = data.joints.length === 0;
  byId('contact').hidden = !touches;
  const legend = byId('legend');
  const entry = (symbol, text) => {
    const item = element('li', {}, legend);
    element('b', {class: symbol}, item);
    element('span', {}, item, text);
  };
  if (touches) entry('symbol-arrow', 'contact force on the robot');
  if (travels) entry('symbol-trace', `path of ${data.links[0].name}`);
  if (data.links.some((link) => link.shapes.some((shape) => shape.collides))) entry('symbol-dark', 'collision shape');
  entry('symbol-hinge', 'motor');
}

function showPanel(t) {
  byId('time').textContent = `${fixed(t, 3)} s`;
  byId('phase').textContent = phaseAfter(t);
  data.joints.forEach((joint, k) => {
    [[joint.position_rad, 3], [joint.velocity_rad_s, 2], [joint.torque_nm, 2]].forEach(([column, digits], c) => {
      cells.joints[k][c].textContent = fixed(motion.value(column, t), digits);
    });
  });
  const root = data.links[0];
  [root.x_m, root.z_m, data.root_pitch_rad].forEach((column, c) => {
    cells.root[c].textContent = fixed(motion.value(column, t), 3);
  });
  cells.contact[0].textContent = data.forces[motion.nearest(t)].length;
  cells.contact[1].textContent = fixed(motion.value(motion.normal, t), 1);
  cells.contact[2].textContent = fixed(motion.value(motion.friction, t), 1);
}

// The strip of poses, as the figures of Albro and Bobrow (2004) show their motions.

function fillStrip() {
  const end = motion.clamp(data.duration_s);
  const times = Array.from({length: stripPoses}, (_, k) => motion.first + (k / (stripPoses - 1)) * (end - motion.first));
  const boxes = times.map((t) => motion.box(motion.poses(t)));
  const width = 1.12 * Math.max(...boxes.map((b) => b[2] - b[0]));
  const low = Math.min(...boxes.map((b) => b[1]));
  const below = 0.035 * width + 0.015;
  const height = 1.04 * (Math.max(...boxes.map((b) => b[3])) - low) + below;
  byId('strip-note').textContent = `${stripPoses} instants evenly spaced over the motion, each centred on the robot`;
  poseButtons = times.map((t) => {
    const button = element('button', {type: 'button', class: 'pose', 'aria-label': `Show ${fixed(t, 3)} s`}, byId('poses'));
    drawPose(button, motion, t, width, height, low - below);
    element('span', {class: 'pose-time'}, button, `${fixed(t, 2)} s`);
    button.addEventListener('click', () => { pause(); seek(t); });
    return [t, button];
  });
}

// Plots over time.

function fillTimePlots() {
  const host = byId('time-plots');
  const shade = motion.settles ? {from: data.duration_s, to: data.settle_s > 0 ? Math.min(motion.last, data.duration_s + data.settle_s) : motion.last, label: data.settle_s > 0 ? 'settling' : 'held'} : null;
  const add = (title, unit, yTicks, digits, curves, limits) => {
    const {y, hidden} = rangeWithLimits(curves.map((c) => c.ys), limits.map((l) => l.value));
    timePlots.push(new Plot(host, {
      title, unit, yTicks, y, limits, shade,
      x: [motion.first, motion.last], xLabel: 'time [s]', xTicks: niceTicks,
      note: hidden ? `limits lie outside: ${limits.map((l) => l.label.replace('limit ', '')).join(', ')}` : '',
      curves: curves.map((c) => ({...c, kind: 'line', xs: motion.times, value: (t) => motion.value(c.ys, t), read: (t) => fixed(motion.value(c.ys, t), digits)})),
      flag: (t) => `${fixed(t, 3)} s`,
      onHover: (t) => { state.hover = t; showPlots(); },
      onSeek: (t) => { pause(); seek(t); },
    }));
  };
  const curvesOf = (key) => data.joints.map((j, k) => ({name: j.name, hue: `hue-${k % 8}`, ys: j[key]}));
  // One grey line for joints of the same limit, else one in the colour of each.
  const limitsOf = (read, show) => {
    const found = new Map();
    data.joints.forEach((j, k) => read(j).forEach((value) => {
      found.set(value, found.has(value) ? 'hue-limit' : `hue-${k % 8}`);
    }));
    return [...found].map(([value, hue]) => ({value, hue, label: `limit ${show(value)}`}));
  };
  if (data.joints.length > 0) {
    add('Joint angle', 'rad', angleTicks, 3, curvesOf('position_rad'),
        limitsOf((j) => j.position_limits_rad || [], (v) => fixed(v, 2)));
    add('Joint velocity', 'rad/s', niceTicks, 2, curvesOf('velocity_rad_s'), []);
    add('Joint torque', 'N·m', niceTicks, 2, curvesOf('torque_nm'),
        limitsOf((j) => (j.torque_limit_nm === null ? [] : [j.torque_limit_nm, -j.torque_limit_nm]), (v) => fixed(v, 1)));
  }
  if (touches) {
    add('Contact force', 'N', niceTicks, 1, [
      {name: 'normal', hue: 'hue-normal', ys: motion.normal},
      {name: 'friction', hue: 'hue-friction', ys: motion.friction},
    ], []);
  }
  const root = data.links[0];
  add('Root pitch', 'rad', angleTicks, 3, [{name: root.name, hue: 'hue-root', ys: data.root_pitch_rad}], []);
  if (travels) add('Root position', 'm', niceTicks, 3, [{name: 'x', hue: 'hue-x', ys: root.x_m}, {name: 'z', hue: 'hue-root', ys: root.z_m}], []);
}

// Plots of the solver's progress.

// An axis for values of which some may be zero or far off: logarithmic where all are positive and span decades.
function progressAxis(values, zeroAllowed) {
  const positive = values.filter((v) => v > 0);
  const least = positive.reduce((a, b) => Math.min(a, b), Infinity);
  const most = positive.reduce((a, b) => Math.max(a, b), 0);
  const all = positive.length === values.length;
  if (positive.length > 0 && (all || (zeroAllowed && values.every((v) => v >= 0))) && (most > 30 * least || !all)) {
    const low = Math.floor(Math.log10(least)) - (all ? 0 : 1);
    const high = Math.max(low + 1, Math.ceil(Math.log10(most)));
    const map = (v) => (v > 0 ? Math.log10(v) : low);
    const yTicks = (a, b, n) => decadeTicks(low, high, n).map((tick) => (!all && tick.value === low ? {...tick, label: '0'} : tick));
    return {map, y: [low - 0.05 * (high - low), high + 0.05 * (high - low)], yTicks, log: true, outside: 0};
  }
  // A few values far from all others would flatten the rest: they go to the edge, and are counted.
  const sorted = [...values].sort((a, b) => a - b);
  let to = sorted[sorted.length - 1];
  const usual = sorted[Math.floor(0.97 * (sorted.length - 1))];
  if (to - sorted[0] > 5 * (usual - sorted[0]) && usual > sorted[0]) to = usual;
  const {y} = rangeWithLimits([[sorted[0], to]], []);
  return {map: (v) => v, y, yTicks: niceTicks, log: false, outside: sorted.filter((v) => v > y[1]).length};
}

function fillSolverPlots() {
  const list = data.evaluations;
  byId('progress').hidden = list.length === 0;
  if (list.length === 0) return;
  const host = byId('solver-plots');
  const numbers = list.map((e) => e.evaluation);
  const range = [Math.min(numbers[0], 0), numbers.reduce((a, b) => Math.max(a, b), numbers[0] + 1)];
  const at = (x) => {
    let best = 0;
    numbers.forEach((n, i) => { if (Math.abs(n - x) < Math.abs(numbers[best] - x)) best = i; });
    return best;
  };
  const add = (title, key, zeroAllowed) => {
    const axis = progressAxis(list.map((e) => e[key]), zeroAllowed);
    const of = (global) => {
      const own = list.filter((e) => e.global === global);
      return {xs: own.map((e) => e.evaluation), ys: own.map((e) => axis.map(e[key]))};
    };
    // The value stands beside the kind of evaluation that the pointer is at.
    const read = (global) => (x) => {
      const i = x === null ? list.length - 1 : at(x);
      return list[i].global === global ? significant(list[i][key]) : '';
    };
    const curves = [
      {name: 'global search', hue: 'hue-search', kind: 'dots', ...of(true), read: read(true)},
      {name: 'local solver', hue: 'hue-solver', kind: 'line', ...of(false)},
      {name: 'local solver', hue: 'hue-solver', kind: 'dots', ...of(false), read: read(false)},
    ].filter((curve) => curve.xs.length > 0);
    solverPlots.push(new Plot(host, {
      title, unit: axis.log ? 'log scale' : '', curves, y: axis.y, yTicks: axis.yTicks, log: axis.log,
      x: range, xLabel: 'evaluation', xTicks: (a, b, n) => niceTicks(a, b, n).filter((t) => Number.isInteger(t.value)),
      note: axis.outside > 0 ? `${axis.outside} above the picture` : '',
      flag: (x) => `evaluation ${list[at(x)].evaluation}`,
      onHover: (x) => solverPlots.forEach((plot) => plot.show(null, x === null ? null : numbers[at(x)])),
    }));
  };
  add('Cost', 'cost', false);
  add('Largest violation', 'violation', true);
  byId('progress-note').textContent = 'after each evaluation; the last values stand beside the names';
}

function fillTable(section, {columns, rows}) {
  const table = section.querySelector('table');
  table.hidden = rows.length === 0;
  const row = (parent, texts, tag) => texts.forEach((text) => element(tag, {}, parent, text));
  row(element('tr', {}, table.tHead), columns, 'th');
  for (const texts of rows) row(element('tr', {}, table.tBodies[0]), texts, 'td');
}

function fillMinima() {
  byId('minima').hidden = data.minima.rows.length === 0;
  byId('minima-note').textContent = 'different motions that the starts led to, best first; the page shows the first that can be used';
  fillTable(byId('minima'), data.minima);
}

function fillWindow() {
  const section = byId('ground-window');
  section.hidden = data.window.rows.length === 0 && data.window_note === '';
  section.querySelector('p').textContent = data.window_note;
  fillTable(section, data.window);
}

function fillCertificate() {
  byId('certificate').hidden = data.certificate.length === 0;
  for (const [name, value] of data.certificate) {
    const row = element('tr', {}, byId('certificate').querySelector('tbody'));
    element('th', {scope: 'row'}, row, name);
    element('td', {}, row, value);
  }
}

// One time for all.

function showPlots() {
  for (const plot of timePlots) plot.show(state.time, state.hover);
}

function showTime(t) {
  stage.draw(t);
  showPanel(t);
  showPlots();
  const near = poseButtons.reduce((best, [time], k) =>
    (Math.abs(time - state.time) < Math.abs(poseButtons[best][0] - state.time) ? k : best), 0);
  poseButtons.forEach(([, button], k) => button.classList.toggle('current', k === near));
}

function listen() {
  const span = motion.last - motion.first;
  const share = motion.settles ? (100 * (data.duration_s - motion.first)) / span : 100;
  byId('slider').style.setProperty('--motion', `${share}%`);
  byId('camera').addEventListener('click', (event) => {
    if (!event.target.dataset.value) return;
    stage.camera = event.target.dataset.value;
    choose('camera', stage.camera);
    layout();
  });
  byId('trail').addEventListener('click', () => {
    stage.trail = !stage.trail;
    choose('trail', null, stage.trail);
    seek(state.time);
  });
  choose('camera', stage.camera);
  window.addEventListener('hashchange', applyFragment);
  for (const cause of ['resize', 'beforeprint', 'afterprint']) window.addEventListener(cause, layout);
}

// The address: t, a time in s; view=robot or view=strip, one picture alone; camera=fit or follow; trail=off, no earlier
// poses; theme=light or dark.
function applyFragment() {
  const parts = fragment();
  document.documentElement.dataset.view = ['robot', 'strip'].includes(parts.get('view')) ? parts.get('view') : 'page';
  applyTheme();
  if (['fit', 'follow'].includes(parts.get('camera'))) {
    stage.camera = parts.get('camera');
    choose('camera', stage.camera);
  }
  if (parts.has('trail')) stage.trail = parts.get('trail') !== 'off';
  choose('trail', null, stage.trail);
  takeTime(parts);
  layout();
}

// On paper everything has the size it takes on A4, so that its text stays readable.
function layout(event) {
  const paper = event?.type === 'beforeprint';
  const large = document.documentElement.dataset.view === 'robot';
  const box = byId('stage').parentElement.getBoundingClientRect();
  if (paper && !large) stage.layout(400, 300, false);
  else if (box.width > 0) stage.layout(box.width, box.height, large);
  for (const plot of [...timePlots, ...solverPlots]) {
    const width = plot.figure.getBoundingClientRect().width;
    plot.layout(paper ? 340 : width > 0 ? width : 480);
  }
  for (const plot of solverPlots) plot.show(null, null);
  seek(state.time);
}

startPlayer(motion, showTime);
fillHeader();
fillPanel();
fillStrip();
fillTimePlots();
fillSolverPlots();
fillMinima();
fillWindow();
fillCertificate();
listen();
applyFragment();
document.documentElement.dataset.ready = 'true';
