// A plot: axes, curves, limits, a cursor that stays and one that follows the pointer.

function niceTicks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((k) => k * power >= raw * 0.999);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) {
    ticks.push({value: k * step, label: fixed(k * step, digits)});
  }
  return ticks;
}

// Multiples of a simple part of pi.
function angleTicks(low, high, count) {
  const raw = (high - low) / Math.min(count, 4) / Math.PI;
  const step = [1 / 4, 1 / 2, 1, 2, 4, 8, 16, 32, 64].find((s) => s >= 0.8 * raw);
  if (high - low < Math.PI / 2 || !step) return niceTicks(low, high, count);
  const ticks = [];
  for (let k = Math.ceil(low / Math.PI / step); k * step * Math.PI <= high; ++k) {
    let [top, under] = step < 1 ? [Math.abs(k), 1 / step] : [Math.abs(k) * step, 1];
    while (top % 2 === 0 && under > 1) [top, under] = [top / 2, under / 2];
    const text = (top === 1 ? 'π' : `${top}π`) + (under > 1 ? `/${under}` : '');
    ticks.push({value: k * step * Math.PI, label: k === 0 ? '0' : (k < 0 ? '−' : '') + text});
  }
  return ticks;
}

function decadeTicks(low, high, count) {
  const from = Math.ceil(low - 1e-9);
  const to = Math.floor(high + 1e-9);
  const step = Math.max(1, Math.ceil((to - from) / count));
  const plain = from >= -3 && to <= 4;
  const ticks = [];
  for (let k = from; k <= to; k += step) ticks.push({value: k, label: plain || k === 0 ? String(10 ** k) : `10${superscript(k)}`});
  return ticks;
}

let clipCount = 0;

// spec: title, unit, x: [from, to], xLabel, xTicks(low, high, count), y: [from, to], yTicks likewise,
//   curves: [{name, hue, kind: 'line' | 'dots' | 'area', xs, ys, read(x): text, value(x): number, for a dot at the cursor}],
//   limits: [{value, hue, label}], shade: {from, to, label}, bands: [{from, to, hue, label}], marks: [{x, hue, text}],
//   note, onSeek(x), onHover(x or null), flag(x): text.
// A value that is null interrupts a curve. The range x may change between layouts.
class Plot {
  constructor(parent, spec) {
    this.spec = spec;
    this.figure = element('figure', {class: 'plot'}, parent);
    const caption = element('figcaption', {}, this.figure);
    const title = element('span', {class: 'name'}, caption, spec.title);
    if (spec.unit) element('i', {}, title, spec.unit);
    const key = element('span', {class: 'key'}, caption);
    this.values = spec.curves.filter((c) => c.read).map((curve) => {
      const entry = element('span', {class: curve.hue}, key);
      element('b', {class: `swatch ${curve.kind}`}, entry);
      element('span', {}, entry, curve.name);
      return [curve, element('output', {}, entry)];
    });
    this.svg = element('svg', {role: 'img', 'aria-label': `${spec.title} by ${spec.xLabel}`}, this.figure);
    this.clip = `clip-${++clipCount}`;
    if (spec.onSeek) this.figure.classList.add('seekable');
    this.listen();
  }

  listen() {
    const {spec, svg} = this;
    const at = (event) => {
      const box = svg.getBoundingClientRect();
      const share = ((event.clientX - box.left) * (this.width / box.width) - this.left) / (this.right - this.left);
      return spec.x[0] + Math.min(Math.max(share, 0), 1) * (spec.x[1] - spec.x[0]);
    };
    let dragging = false;
    svg.addEventListener('pointermove', (event) => {
      if (dragging) spec.onSeek(at(event));
      spec.onHover(dragging ? null : at(event));
    });
    svg.addEventListener('pointerleave', () => spec.onHover(null));
    if (!spec.onSeek) return;
    svg.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      dragging = true;
      if (event.isTrusted) svg.setPointerCapture(event.pointerId);
      spec.onHover(null);
      spec.onSeek(at(event));
    });
    for (const end of ['pointerup', 'pointercancel']) svg.addEventListener(end, () => { dragging = false; });
  }

  // The height follows from the width where none is given.
  layout(width, given = null) {
    const {spec, svg} = this;
    this.width = width;
    const height = this.height = given ?? Math.round(Math.min(250, Math.max(190, width * 0.42)));
    this.left = 48;
    this.right = width - 10;
    this.top = 16;
    this.bottom = height - 38;
    svg.replaceChildren();
    svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const px = (x) => this.left + ((x - spec.x[0]) / (spec.x[1] - spec.x[0])) * (this.right - this.left);
    const py = (y) => this.bottom - ((y - spec.y[0]) / (spec.y[1] - spec.y[0])) * (this.bottom - this.top);
    this.px = px;
    this.py = py;
    const clip = element('clipPath', {id: this.clip}, element('defs', {}, svg));
    element('rect', {x: this.left - 3, y: this.top - 3, width: this.right - this.left + 6, height: this.bottom - this.top + 6}, clip);

    if (spec.shade) {
      const [from, to] = [px(spec.shade.from), px(spec.shade.to)];
      element('rect', {class: 'shade', x: from, y: this.top, width: to - from, height: this.bottom - this.top}, svg);
      if (to - from > 44) element('text', {class: 'shade-label', x: to, y: this.top - 4}, svg, spec.shade.label);
    }
    const back = element('g', {'clip-path': `url(#${this.clip})`}, svg);
    for (const band of spec.bands || []) {
      if (band.to < spec.x[0] || band.from > spec.x[1]) continue;
      const rect = element('rect', {class: `band ${band.hue}`, x: px(band.from), y: this.top,
        width: Math.max(0, px(band.to) - px(band.from)), height: this.bottom - this.top}, back);
      element('title', {}, rect, band.label);
    }
    for (const tick of spec.yTicks(spec.y[0], spec.y[1], height > 215 ? 5 : 4)) {
      const y = py(tick.value);
      element('line', {class: tick.value === 0 && !spec.log ? 'grid zero' : 'grid', x1: this.left, x2: this.right, y1: y, y2: y}, svg);
      element('text', {class: 'y', x: this.left - 8, y: y + 3.8}, svg, tick.label);
    }
    for (const tick of spec.xTicks(spec.x[0], spec.x[1], Math.max(3, width / 70))) {
      const x = px(tick.value);
      element('line', {class: 'mark', x1: x, x2: x, y1: this.bottom, y2: this.bottom + 4}, svg);
      element('text', {class: 'x', x, y: this.bottom + 17}, svg, tick.label);
    }
    element('line', {class: 'axis', x1: this.left, x2: this.right, y1: this.bottom, y2: this.bottom}, svg);
    element('text', {class: 'x label', x: (this.left + this.right) / 2, y: height - 5}, svg, spec.xLabel);

    for (const limit of spec.limits || []) {
      if (limit.value < spec.y[0] || limit.value > spec.y[1]) continue;
      const y = py(limit.value);
      element('line', {class: `limit ${limit.hue}`, x1: this.left, x2: this.right, y1: y, y2: y}, svg);
      const above = limit.value < 0;
      element('text', {class: `limit-label ${limit.hue}`, x: this.left + 5, y: above ? y - 4 : y + 12}, svg, limit.label);
    }
    const curves = element('g', {'clip-path': `url(#${this.clip})`}, svg);
    for (const mark of spec.marks || []) {
      if (mark.x < spec.x[0] || mark.x > spec.x[1]) continue;
      const line = element('line', {class: `event ${mark.hue}`, x1: px(mark.x), x2: px(mark.x), y1: this.top, y2: this.bottom}, curves);
      element('title', {}, line, mark.text);
    }
    for (const curve of spec.curves) {
      const d = this.path(curve);
      if (d) element('path', {class: `${curve.kind} ${curve.hue}`, d}, curves);
    }
    if (spec.note) element('text', {class: 'note', x: this.right - 4, y: this.bottom - 6}, svg, spec.note);

    this.cursor = element('line', {class: 'cursor', y1: this.top, y2: this.bottom}, svg);
    this.pointer = element('line', {class: 'pointer', y1: this.top, y2: this.bottom}, svg);
    this.dots = spec.curves.filter((c) => c.value).map((curve) => [curve, element('circle', {class: `dot ${curve.hue}`, r: 3.2}, svg)]);
    this.flag = element('text', {class: 'flag', y: this.top - 4}, svg);
    this.show(this.shown ?? null, null);
  }

  // The points in the range, and one more on either side.
  path(curve) {
    const {spec, px, py} = this;
    const parts = [];
    let open = false;
    const at = (i) => `${px(curve.xs[i]).toFixed(2)} ${py(Math.min(Math.max(curve.ys[i], spec.y[0]), spec.y[1])).toFixed(2)}`;
    for (let i = 0; i < curve.xs.length; ++i) {
      const outside = (i + 1 < curve.xs.length && curve.xs[i + 1] < spec.x[0]) || (i > 0 && curve.xs[i - 1] > spec.x[1]);
      if (outside || curve.ys[i] === null) {
        open = false;
      } else if (curve.kind === 'dots') {
        parts.push(`M${at(i)}h0`);
      } else {
        parts.push(`${open ? 'L' : 'M'}${at(i)}`);
        open = true;
      }
    }
    if (curve.kind === 'area' && parts.length > 0) {
      parts.push(`L${px(curve.xs[curve.xs.length - 1])} ${this.bottom}L${px(curve.xs[0])} ${this.bottom}z`);
    }
    return parts.join('');
  }

  // `now` is where the animation is (or null), `hover` where the pointer is (or null); the values are the pointer's.
  show(now, hover) {
    this.shown = now;
    for (const [line, x] of [[this.cursor, now], [this.pointer, hover]]) {
      const shown = x !== null && x >= this.spec.x[0] && x <= this.spec.x[1];
      line.style.display = shown ? '' : 'none';
      if (!shown) continue;
      line.setAttribute('x1', this.px(x));
      line.setAttribute('x2', this.px(x));
    }
    this.flag.textContent = hover === null ? '' : this.spec.flag(hover);
    if (hover !== null) {
      const x = this.px(hover);
      const left = x > this.width - 110;
      this.flag.setAttribute('x', left ? x - 5 : x + 5);
      this.flag.setAttribute('text-anchor', left ? 'end' : 'start');
    }
    const x = hover ?? now;
    for (const [curve, dot] of this.dots) {
      const y = curve.value(x);
      dot.style.display = y === null || x < this.spec.x[0] || x > this.spec.x[1] ? 'none' : '';
      if (y === null) continue;
      dot.setAttribute('cx', this.px(x));
      dot.setAttribute('cy', this.py(y));
    }
    for (const [curve, output] of this.values) output.textContent = curve.read(x);
  }
}

// Limits belong in the picture as long as the curves keep a fair share of it.
function rangeWithLimits(columns, limits) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of columns) {
    for (const value of column) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) [low, high] = [0, 0];
  if (high - low < 1e-9) [low, high] = [low - 0.5, high + 0.5];
  const span = high - low;
  const [from, to] = [Math.min(low, ...limits), Math.max(high, ...limits)];
  const hidden = span < 0.12 * (to - from);
  const pad = 0.06 * (hidden ? span : to - from);
  return {y: hidden ? [low - pad, high + pad] : [from - pad, to + pad], hidden};
}
