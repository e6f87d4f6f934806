// One time for the whole page: playing, the slider, the keys and the address. A page calls startPlayer with its times
// (first, last, clamp, nearest, times) and with what shows a time; it has the elements play, slider, speed and repeat.

const byId = (id) => document.getElementById(id);

function fragment() {
  return new URLSearchParams(location.hash.slice(1));
}

const state = {time: 0, hover: null, playing: false, speed: 1, repeat: false};
const player = {};

function seek(t) {
  state.time = player.times.clamp(t);
  player.show(state.time);
  byId('slider').value = state.time;
  byId('slider').setAttribute('aria-valuetext', `${fixed(state.time, 3)} s`);
}

let previous = null;

function frame(now) {
  if (!state.playing) return;
  const step = previous === null ? 0 : (Math.min(now - previous, 100) / 1000) * state.speed;
  previous = now;
  if (state.time + step < player.times.last) {
    seek(state.time + step);
  } else if (state.repeat) {
    seek(player.times.first);
  } else {
    seek(player.times.last);
    pause();
    return;
  }
  requestAnimationFrame(frame);
}

function showPlayButton() {
  byId('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  byId('play').querySelector('path').setAttribute('d', state.playing ? 'M5 3.5h3.6v13H5zM11.4 3.5H15v13h-3.6z' : 'M6 3.5v13l11-6.5z');
}

function play() {
  if (state.playing) return;
  if (state.time >= player.times.last) seek(player.times.first);
  state.playing = true;
  previous = null;
  showPlayButton();
  requestAnimationFrame(frame);
}

function pause() {
  state.playing = false;
  showPlayButton();
  keepTime();
}

// Keeps the time in the address, so that a reload or a copied link shows the same instant.
let keeping = null;
function keepTime() {
  clearTimeout(keeping);
  keeping = setTimeout(() => {
    const parts = fragment();
    parts.set('t', state.time.toFixed(3));
    try {
      history.replaceState(null, '', `#${parts}`);
    } catch (error) {
      // Some browsers forbid this on a page from a file; the page works without it.
    }
  }, 300);
}

function choose(id, value, pressed) {
  for (const button of byId(id).querySelectorAll('button')) {
    button.setAttribute('aria-pressed', pressed ?? button.dataset.value === value);
  }
}

// The time that the address asks for.
function takeTime(parts) {
  const asked = parseFloat(parts.get('t'));
  if (!Number.isFinite(asked)) return;
  state.playing = false;
  showPlayButton();
  state.time = player.times.clamp(asked);
}

function applyTheme() {
  const asked = fragment().get('theme');
  const dark = asked ? asked === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
  document.documentElement.dataset.theme = dark ? 'dark' : 'light';
}

function startPlayer(times, show) {
  player.times = times;
  player.show = show;
  state.time = times.first;
  const slider = byId('slider');
  slider.min = times.first;
  slider.max = times.last;
  slider.addEventListener('input', () => { pause(); seek(Number(slider.value)); });
  byId('play').addEventListener('click', () => (state.playing ? pause() : play()));
  byId('speed').addEventListener('click', (event) => {
    if (!event.target.dataset.value) return;
    state.speed = Number(event.target.dataset.value);
    choose('speed', event.target.dataset.value);
  });
  byId('repeat').addEventListener('click', () => {
    state.repeat = !state.repeat;
    choose('repeat', null, state.repeat);
  });
  choose('speed', '1');
  choose('repeat', null, false);

  // A button clicked with the pointer gives the space bar back to play and pause.
  document.addEventListener('click', (event) => {
    if (event.detail > 0 && document.activeElement?.tagName === 'BUTTON') document.activeElement.blur();
  });
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const onButton = event.target.tagName === 'BUTTON';
    const step = (direction) => {
      if (event.shiftKey) return state.time + direction * 0.1;
      const i = times.nearest(state.time);
      return times.times[Math.min(Math.max(i + direction, 0), times.times.length - 1)];
    };
    const actions = {
      ' ': onButton ? null : () => (state.playing ? pause() : play()),
      ArrowLeft: () => { pause(); seek(step(-1)); },
      ArrowRight: () => { pause(); seek(step(1)); },
      Home: () => { pause(); seek(times.first); },
      End: () => { pause(); seek(times.last); },
    };
    const action = Object.hasOwn(actions, event.key) ? actions[event.key] : null;
    if (!action) return;
    event.preventDefault();
    action();
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', applyTheme);
}
