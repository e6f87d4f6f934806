// The page of a motion in space: one time, shown by the stage, the figures beside it, the slider, the poses and every plot.

const data = JSON.parse(byId('data').textContent);
const motion = new SpaceMotion(data);
const stage = new SpaceStage(byId('stage'), motion);
const poseLinks = [...document.querySelectorAll('.pose')];
const timePlots = [];
const settles = motion.last - data.motion_s > 1e-9;
const touches = data.contacts.some((list) => list.length > 0);

// What moves on a slow machine is less sharp until it stands still.
let sharpening = null;
function redraw() {
  if (!(stage.width > 0)) return;
  stage.draw(state.time);
  clearTimeout(sharpening);
  if (stage.sharpness < sharpest()) sharpening = setTimeout(() => stage.draw(state.time, true), 250);
}

// Figures and legend.

const cellsOf = (table) => [...byId(table).querySelectorAll('td')];
const cells = {root: cellsOf('root'), attitude: cellsOf('attitude'), contact: cellsOf('contact')};

function fillPanel() {
  byId('root').querySelector('th span').textContent = data.bodies[0].name;
  byId('contact').hidden = !touches;
  const entry = (symbol, text) => {
    const item = element('li', {}, byId('legend'));
    element('b', {class: symbol}, item);
    element('span', {}, item, text);
  };
  if (touches) {
    const most = Math.max(...motion.times.flatMap((t) => motion.contacts(t).map(({force}) => length(force))));
    entry('symbol-arrow', `contact force on the robot, at most ${fixed(most, 0)} N`);
  }
  if (data.carpets.length > 0) entry('symbol-cell', `grid of ${plain(data.step_m)} m`);
  if (data.carpets.some((carpet) => carpet.ground)) entry('symbol-shadow', 'shadow, straight below');
  entry('symbol-path', `path of ${data.bodies[0].name}`);
}

function showPanel(t) {
  byId('time').textContent = `${fixed(t, 3)} s`;
  byId('phase').textContent = settles && t > data.motion_s ? 'after the motion' : '';
  const {at, axes: [x, y, z]} = motion.poses(t)[0];
  at.forEach((value, k) => { cells.root[k].textContent = fixed(value, 3); });
  // The rotation is yaw, then pitch, then roll, about the axes as they are then.
  const level = Math.hypot(x[0], x[1]);
  const angles = level > 1e-3 ? [Math.atan2(y[2], z[2]), Math.atan2(-x[2], level), Math.atan2(x[1], x[0])]
    : [0, Math.atan2(-x[2], level), Math.atan2(-y[0], y[1])];
  angles.forEach((value, k) => { cells.attitude[k].textContent = fixed(value, 3); });
  const contacts = motion.contacts(t);
  const sum = contacts.reduce((total, {force}) => add(total, force), [0, 0, 0]);
  [String(contacts.length), fixed(sum[2], 1), fixed(Math.hypot(sum[0], sum[1]), 1)].forEach((text, k) => { cells.contact[k].textContent = text; });
}

// Plots.

const plain = (value) => String(Number(value.toPrecision(4))).replace('-', '−');

function fillPlots() {
  byId('histories').hidden = data.plots.length === 0;
  const shade = settles ? {from: data.motion_s, to: motion.last, label: 'after'} : null;
  for (const plot of data.plots) {
    const {y, hidden} = rangeWithLimits(plot.series.map((s) => s.values), plot.limits);
    const digits = y[1] - y[0] > 50 ? 1 : y[1] - y[0] > 5 ? 2 : 3;
    timePlots.push(new Plot(byId('time-plots'), {
      title: plot.title, unit: plot.unit, y, yTicks: plot.unit === 'rad' ? angleTicks : niceTicks, shade,
      limits: plot.limits.map((value) => ({value, hue: 'hue-limit', label: `limit ${plain(value)}`})),
      x: [motion.first, motion.last], xLabel: 'time [s]', xTicks: niceTicks,
      note: hidden ? `limits lie outside: ${plot.limits.map(plain).join(', ')}` : '',
      curves: plot.series.map((s) => ({name: s.name, hue: `hue-${s.hue}`, kind: 'line', xs: motion.times, ys: s.values,
        value: (t) => motion.value(s.values, t), read: (t) => shown(motion.value(s.values, t), digits)})),
      flag: (t) => `${fixed(t, 3)} s`,
      onHover: (t) => { state.hover = t; showPlots(); },
      onSeek: (t) => { pause(); seek(t); },
    }));
  }
}

function showPlots() {
  for (const plot of timePlots) plot.show(state.time, state.hover);
}

function showTime(t) {
  redraw();
  showPanel(t);
  showPlots();
  const distance = (link) => Math.abs(Number(link.dataset.t) - t);
  const nearest = poseLinks.reduce((best, link) => (distance(link) < distance(best) ? link : best));
  for (const link of poseLinks) link.classList.toggle('current', link === nearest);
}

// The view.

function lookFrom(azimuth, elevation) {
  stage.look(azimuth, elevation);
  const same = (name) => viewpoints[name][0] === stage.azimuth && viewpoints[name][1] === stage.elevation;
  choose('from', Object.keys(viewpoints).find(same));
}

function turn(azimuth, elevation) {
  lookFrom(stage.azimuth + azimuth, stage.elevation + elevation);
  redraw();
}

function resize(factor) {
  stage.zoom = between(0.1, stage.zoom * factor, 40);
  redraw();
}

// What a button asks for fills the stage again.
function reset() {
  stage.zoom = 1;
  stage.fit();
  redraw();
}

function follow(camera) {
  stage.camera = camera;
  choose('camera', camera);
}

function listenToPointers() {
  const canvas = byId('stage');
  const fingers = new Map();
  let before = null;  // the angles, to which the view returns where a touch turns out to scroll the page
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  canvas.addEventListener('pointerdown', (event) => {
    if (event.pointerType === 'mouse' && event.button !== 0) return;
    if (fingers.size === 0) before = [stage.azimuth, stage.elevation];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (event.isTrusted) canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    const from = fingers.get(event.pointerId);
    if (!from) return;
    const was = spread();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) turn(-0.45 * (event.clientX - from[0]), 0.45 * (event.clientY - from[1]));
    else if (was > 0) resize(spread() / was);
  });
  canvas.addEventListener('pointerup', (event) => fingers.delete(event.pointerId));
  canvas.addEventListener('pointercancel', (event) => {
    if (!fingers.delete(event.pointerId)) return;
    lookFrom(...before);
    redraw();
  });
  // The page scrolls until the view was clicked; a pinch on a touchpad comes as a wheel with ctrl.
  canvas.addEventListener('wheel', (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    resize(Math.exp(-(event.ctrlKey ? 0.01 : 0.0015) * event.deltaY));
  }, {passive: false});
  canvas.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions = {
      ArrowLeft: () => turn(5, 0), ArrowRight: () => turn(-5, 0), ArrowUp: () => turn(0, 5), ArrowDown: () => turn(0, -5),
      '+': () => resize(1.2), '=': () => resize(1.2), '-': () => resize(1 / 1.2),
    };
    const action = Object.hasOwn(actions, event.key) ? actions[event.key] : null;
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  });
}

function listen() {
  listenToPointers();
  const share = settles ? (100 * (data.motion_s - motion.first)) / (motion.last - motion.first) : 100;
  byId('slider').style.setProperty('--motion', `${share}%`);
  const onChoice = (id, act) => byId(id).addEventListener('click', (event) => {
    const {value} = event.target.dataset;
    if (value) act(value);
  });
  onChoice('camera', (value) => { follow(value); reset(); });
  onChoice('from', (value) => { lookFrom(...viewpoints[value]); reset(); });
  onChoice('size', (value) => resize(1.2 ** Number(value)));
  onChoice('ends', () => {
    stage.ends = !stage.ends;
    choose('ends', null, stage.ends);
    redraw();
  });
  for (const link of poseLinks) {
    link.addEventListener('click', (event) => {
      event.preventDefault();
      pause();
      seek(Number(link.dataset.t));
    });
  }
  choose('ends', null, false);
  follow(stage.camera);
  lookFrom(...viewpoints.corner);
  window.addEventListener('hashchange', applyFragment);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
  for (const cause of ['resize', 'beforeprint', 'afterprint']) window.addEventListener(cause, layout);
}

// The address: t, a time in s; from=side, front, top, corner or azimuth,elevation in degrees; camera=fit or follow;
// view=robot or view=strip, one picture alone; theme=light or dark.
function applyFragment() {
  const parts = fragment();
  document.documentElement.dataset.view = ['robot', 'strip'].includes(parts.get('view')) ? parts.get('view') : 'page';
  applyTheme();
  if (['fit', 'follow'].includes(parts.get('camera'))) follow(parts.get('camera'));
  const from = parts.get('from') || '';
  const angles = from.split(',').map(parseFloat);
  if (Object.hasOwn(viewpoints, from)) lookFrom(...viewpoints[from]);
  else if (angles.length === 2 && angles.every(Number.isFinite)) lookFrom(...angles);
  takeTime(parts);
  layout();
}

// On paper plots have the size they take on A4, so that their text stays readable; the poses stand for the stage.
function layout(event) {
  const paper = event?.type === 'beforeprint';
  const box = byId('stage').parentElement.getBoundingClientRect();
  if (!paper && box.width > 0) stage.layout(box.width, box.height);
  for (const plot of timePlots) {
    const width = plot.figure.getBoundingClientRect().width;
    plot.layout(paper ? 340 : width > 0 ? width : 480);
  }
  seek(state.time);
}

startPlayer(motion, showTime);
fillPanel();
fillPlots();
listen();
applyFragment();
document.documentElement.dataset.ready = 'true';
