// The page of one run: while it happens, from server-sent events, or played from the frames of its record. Texts of
// others (names, events) reach the document as text only.

const data = JSON.parse(byId('data').textContent);
const live = data.mode === 'live';
const scene = data.scene;
const staleAfter = 0.5;  // s

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);
const setText = (id, text) => { if (byId(id).textContent !== text) byId(id).textContent = text; };

// The motion of a robot that nobody knows beforehand: its last pose, and the way of its root.
class LivePose {
  constructor(poses) {
    this.data = {...scene, forces: [], duration_s: 0,
      links: scene.links.map((link, k) => ({...link, x_m: [poses[k][0]], z_m: [poses[k][1]], pitch_rad: [poses[k][2]]}))};
    this.data.forces.push([]);
    this.times = [0];
    this.first = this.last = 0;
    this.way = [];
    this.current = poses;
  }

  clamp() { return 0; }
  locate() { return [this.way.length - 1, 0]; }
  nearest() { return 0; }
  value() { return this.current[0][0]; }
  poses() { return this.current; }
  posesOfSample() { return this.current; }
  box(poses) { return Motion.prototype.box.call(this, poses); }
}

let stage = null;

// On paper the picture has the size that it takes on A4, so that its text stays readable.
function layoutStage(event) {
  const box = byId('stage').parentElement.getBoundingClientRect();
  if (stage && event?.type === 'beforeprint') stage.layout(400, 300, false);
  else if (stage && box.width > 0) stage.layout(box.width, box.height, document.documentElement.dataset.view === 'robot');
}

function drawLive(poses) {
  if (!stage) {
    stage = new Stage(byId('stage'), new LivePose(poses), 0);
    stage.camera = 'follow';
    stage.path = stage.motion.way;
    layoutStage();
  }
  const {motion} = stage;
  motion.current = poses;
  motion.way.push(`${poses[0][0]} ${poses[0][1]}`);
  if (motion.way.length > 500) motion.way.shift();
  // The picture has room for every pose that was seen.
  const box = motion.box(poses);
  const reach = Math.max(stage.reach, box[2] - box[0], box[3] - box[1]);
  if (reach > stage.reach || box[1] < stage.bounds[1] || box[3] > stage.bounds[3]) {
    stage.reach = reach;
    stage.bounds = [box[0], Math.min(box[1], stage.bounds[1]), box[2], Math.max(box[3], stage.bounds[3])];
    layoutStage();
  }
  stage.draw(0);
}

// The rows of a table as texts; the elements are kept, so that a selection survives.
function fillRows(body, rows, decorate) {
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((texts, r) => {
    const tr = body.rows[r] || body.insertRow();
    texts.forEach((text, c) => {
      const td = tr.cells[c] || tr.insertCell();
      const node = td.querySelector('span') || element('span', {}, td);
      if (node.textContent !== text) node.textContent = text;
    });
    if (decorate) decorate(tr, r);
  });
}

// Virtual time has no latencies: what is nowhere above 0 was not measured.
const micros = (list) => (list.some((us) => us > 0) ? `${list.map((us) => shown(us, 0)).join(' / ')} µs` : '–');

function figureRows(frame) {
  const f = frame.figures;
  const rows = [['state', frame.state], ['node', `${frame.node} at ${shown(frame.primitive_time_s, 3)} s, ${frame.cycles} cycles`]];
  if (f) {
    rows.push(['bus load, at most', isNumber(f.bus_load_max) ? `${fixed(100 * f.bus_load_max, 1)} %` : '–']);
    rows.push(['wake-up p50 / p99 / max', micros(f.wake_up_us)]);
    rows.push(['tick p50 / p99 / max', micros(f.tick_us)]);
  }
  rows.push(['this tick: wake-up / tick', micros([frame.wake_up_us, frame.tick_us])]);
  if (f) {
    rows.push(['ticks, late, missed', `${f.ticks}, ${f.late_ticks}, ${f.missed_ticks}`]);
    if (live) rows.push(['not recorded, sent, received', `${f.lost_records}, ${f.unpublished}, ${f.not_received}`]);
  }
  if (frame.sensor) rows.push(['sensor', `${frame.sensor.status}, ${shown(frame.sensor.pitch_rad, 4)} rad, feedback ${shown(100 * frame.sensor.feedback_share, 0)} %`]);
  return rows;
}

function showFrame(frame) {
  const f = frame.figures;
  setText('title', f ? f.motion : '…');
  setText('subtitle', f ? [f.robot, `on ${f.bus}`, f.mode, `${f.rate_hz} Hz`, `speed ${f.speed}`, f.version && `tumbler ${f.version}`].filter(Boolean).join(', ') : '');
  setText('time', `${shown(frame.time_s, 3)} s`);
  setText('phase', `${frame.state}: ${frame.node}`);
  setText('fault', frame.fault === null ? 'no fault' : frame.fault);
  byId('fault').classList.toggle('latched', frame.fault !== null);
  fillRows(byId('run-figures').tBodies[0], figureRows(frame), (tr) => {
    const load = tr.cells[0].textContent.startsWith('bus load') && f && isNumber(f.bus_load_max);
    const bar = tr.querySelector('.load');
    if (!load && bar) bar.remove();
    if (!load) return;
    const own = bar || element('em', {class: 'load'}, null);
    if (!bar) { element('b', {}, own); tr.cells[1].prepend(own); }
    own.firstChild.style.width = `${Math.min(Math.max(100 * f.bus_load_max, 0), 100)}%`;
  });
  fillRows(byId('joints').querySelector('tbody'), frame.joints.map((j) => [j.name, shown(j.setpoint_rad, 4), shown(j.measured_rad, 4),
    shown(j.following_error_rad, 5), shown(j.measured_rad_s, 3), shown(j.measured_nm, 2), shown(j.temperature_c, 1),
    j.reply_age_ticks < 0 ? 'never' : String(j.reply_age_ticks), j.drive + (j.drive_error ? `, error ${j.drive_error}` : '')]), (tr, r) => {
    if (!tr.querySelector('.swatch')) tr.cells[0].prepend(element('b', {class: `swatch hue-${r % 8}`}));
  });
  setText('place', !frame.poses ? '' : frame.root_is_true ? 'The robot is where the simulation has it.'
    : 'Where the robot is was not measured: its root is drawn where the plan has it.');
}

function showEvents(events) {
  fillRows(byId('events').querySelector('tbody'), [...events].reverse().slice(0, 40).map((e) => [`${shown(e.time_s, 3)} s`, e.text]));
  byId('events').hidden = events.length === 0;
}

// While it happens.

let heardAt = null;
let run = null;

function notice(text) {
  byId('notice').hidden = text === '';
  setText('notice', text);
}

function showMessage(message) {
  heardAt = performance.now();
  if (message.run !== run && stage) {  // Another run begins: its robot may be anywhere.
    byId('stage').replaceChildren();
    stage = null;
  }
  if (message.run !== run) setText('asked', '');
  run = message.run;
  const {frame} = message;
  const stale = frame !== null && message.age_s > staleAfter;
  document.body.classList.toggle('stale', stale);
  const others = message.others.length > 0 ? `${message.others.length} other ${message.others.length === 1 ? 'run publishes' : 'runs publish'} here too` +
    ` (${message.others.map((name) => name || 'without a name').join(', ')}); --robot chooses one. ` : '';
  const unreadable = message.unreadable > 0 ? `${message.unreadable} messages could not be read. ` : '';
  notice(frame === null ? `Nothing is heard yet. ${others}${unreadable}`.trim()
    : stale ? `Nothing received for ${fixed(message.age_s, 1)} s: what is shown is old. ${others}${unreadable}`.trim() : `${others}${unreadable}`.trim());
  for (const id of ['stop', 'disarm']) byId(id).disabled = run === null;
  if (message.asked) setText('asked', `${message.asked.request}: ${message.asked.answer || 'asked'}`);
  byId('no-picture').hidden = Boolean(frame && frame.poses);
  setText('no-picture', !scene ? 'tumbler view --motion FILE shows the robot here.'
    : !message.robot_fits ? 'The file of --motion is of a robot with other joints.' : 'No pose of the robot is known yet.');
  if (frame === null) return;
  showFrame(frame);
  showEvents(message.events);
  if (frame.poses) drawLive(frame.poses);
}

async function ask(what) {
  setText('asked', `${what}: asked`);
  try {
    const answer = await fetch(what, {method: 'POST', body: String(run)});
    if (!answer.ok) setText('asked', `${what}: not sent: ${(await answer.text()).trim()}`);
  } catch (error) {
    setText('asked', `${what}: NOT SENT, tumbler view does not answer: use tumbler ctl, or cut the power`);
  }
}

function listen() {
  const source = new EventSource('events');
  source.onmessage = (event) => showMessage(JSON.parse(event.data));
  source.onerror = () => {
    if (source.readyState !== EventSource.CLOSED) return;
    source.close();
    setTimeout(listen, 2000);
  };
}

function startLive() {
  byId('playback').hidden = true;
  setText('kicker', `Live, ${data.name}`);
  setText('title', '…');
  for (const id of ['stop', 'disarm']) byId(id).addEventListener('click', () => ask(id));
  byId('events').hidden = true;
  notice('Nothing is heard yet.');
  setInterval(() => {
    if (heardAt === null || performance.now() - heardAt < 2000) return;
    document.body.classList.add('stale');
    notice(`tumbler view does not answer for ${fixed((performance.now() - heardAt) / 1000, 0)} s: what is shown is old.`);
  }, 500);
  listen();
}

// From a record.

function motionOfFrames(frames) {
  let known = frames.find((frame) => frame.poses);
  if (!known) return null;
  const poses = frames.map((frame) => { known = frame.poses ? frame : known; return known.poses; });
  const times = frames.map((frame) => frame.time_s);
  return new Motion({...scene, times_s: times, duration_s: times[times.length - 1], forces: times.map(() => []),
    links: scene.links.map((link, k) => ({...link, x_m: poses.map((p) => p[k][0]), z_m: poses.map((p) => p[k][1]), pitch_rad: poses.map((p) => p[k][2])}))});
}

function startRecord() {
  const {frames, events} = data;
  byId('ending').hidden = true;
  setText('kicker', `Record, ${data.name}`);
  const motion = motionOfFrames(frames);
  byId('no-picture').hidden = motion !== null;
  setText('no-picture', 'No pose of the robot is in this record.');
  stage = motion && new Stage(byId('stage'), motion, 0);
  const times = frames.map((frame) => frame.time_s);
  const axis = new Motion({times_s: times, duration_s: times[times.length - 1], forces: []});
  startPlayer(axis, (t) => {
    const [i, share] = axis.locate(t);
    showFrame(frames[share < 1 ? i : i + 1]);
    showEvents(events.filter((event) => event.time_s <= t + 1e-9));
    if (stage) stage.draw(t);
  });
  byId('slider').style.setProperty('--motion', '100%');
  byId('camera').addEventListener('click', (event) => {
    if (!event.target.dataset.value || !stage) return;
    stage.camera = event.target.dataset.value;
    choose('camera', stage.camera);
    layoutStage();
    seek(state.time);
  });
  if (stage) choose('camera', stage.camera);
  const apply = () => { applyTheme(); takeTime(fragment()); layoutStage(); seek(state.time); };
  window.addEventListener('hashchange', apply);
  apply();
}

document.documentElement.dataset.view = fragment().get('view') === 'robot' ? 'robot' : 'page';
applyTheme();
for (const cause of ['resize', 'beforeprint', 'afterprint']) {
  window.addEventListener(cause, (event) => { layoutStage(event); if (stage) stage.draw(live ? 0 : state.time); });
}
if (live) startLive(); else startRecord();
document.documentElement.dataset.ready = 'true';
