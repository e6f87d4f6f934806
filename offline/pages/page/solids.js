// Solids in a parallel projection, pixel by pixel with their depth: balls, tubes with round ends, and boxes. What goes
// through each other looks like it. A rounded box is made of the three.

const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const scaled = (a, k) => [k * a[0], k * a[1], k * a[2]];
const length = (a) => Math.sqrt(dot(a, a));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// A shape of the data as parts: {a, b, r}, a tube from a to b, or {c, sides}, a box with three half sides.
function partsOf(shape) {
  const {c, r} = shape;
  if (!shape.h) return [{a: c, b: c, r}];
  const sides = [0, 1, 2].map((i) => scaled(shape.axes[i], shape.h[i]));
  const long = [0, 1, 2].filter((i) => shape.h[i] > 0);
  if (long.length === 1) return [{a: add(c, sides[long[0]]), b: add(c, sides[long[0]], -1), r}];
  const grown = (i) => sides.map((side, k) => (k === i ? scaled(shape.axes[k], shape.h[k] + r) : side));
  if (r === 0) return [{c, sides}];
  const parts = [0, 1, 2].map((i) => ({c, sides: grown(i)}));
  for (const i of [0, 1, 2]) {
    const [j, k] = [(i + 1) % 3, (i + 2) % 3];
    for (const [u, v] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      const middle = add(add(c, sides[j], u), sides[k], v);
      parts.push({a: add(middle, sides[i]), b: add(middle, sides[i], -1), r});
    }
  }
  return parts;
}

// The corners of a part's core.
function cornersOf(part) {
  if (part.a) return part.a === part.b ? [part.a] : [part.a, part.b];
  return [0, 1, 2].reduce((points, i) => points.flatMap((p) => [add(p, part.sides[i]), add(p, part.sides[i], -1)]), [part.c]);
}

// The light comes over the viewer's left shoulder, as in the poses that C++ draws.
const light = scaled([-0.35, 0.7, 0.62], 1 / length([-0.35, 0.7, 0.62]));
const brightness = (x, y, z) => (0.5 + 0.58 * Math.max(0, x * light[0] + y * light[1] + z * light[2])) * (0.82 + 0.18 * z);

// A picture with depth. Coordinates of solids are right, up and towards the viewer, in pixels from its lower left.
class SolidPicture {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.depth = new Float32Array(width * height);
    this.found = new Float64Array(4);
  }

  // Empty, but for planes z = a x + b y + c, which hide what is behind them.
  clear(planes) {
    this.planes = planes;
    this.pixels.fill(0);
    this.depth.fill(-Infinity);
  }

  // Goes through the pixels of a rectangle: row(y) says from and to where a row may be met, hit(column) whether it is
  // met there, with depth and normal in `found`. Numbers that are not whole and are handed over for every pixel would
  // take far longer than what is done with them.
  each(low, high, colour, row, hit) {
    const {width, height, pixels, depth, planes, found} = this;
    const top = Math.max(0, Math.floor(height - high[1]));
    const bottom = Math.min(height - 1, Math.ceil(height - low[1]));
    const [red, green, blue] = colour;
    for (let line = top; line <= bottom; ++line) {
      const y = height - line - 0.5;
      const [from, to] = row(y);
      const left = Math.max(0, Math.floor(from));
      const right = Math.min(width - 1, Math.ceil(to));
      for (let x = left, i = line * width + left; x <= right; ++x, ++i) {
        if (!hit(x)) continue;
        const z = found[0];
        if (!(z > depth[i])) continue;
        let hidden = false;
        for (const p of planes) hidden ||= z < p[0] * (x + 0.5) + p[1] * y + p[2];
        if (hidden) continue;
        depth[i] = z;
        const k = brightness(found[1], found[2], found[3]);
        pixels[i] = 0xff000000 | (Math.min(255, k * blue) << 16) | (Math.min(255, k * green) << 8) | Math.min(255, k * red);
      }
    }
  }

  tube(a, b, r, colour) {
    const {found} = this;
    const l = length(add(b, a, -1));
    const [dx, dy, dz] = l > 0 ? scaled(add(b, a, -1), 1 / l) : [0, 0, 1];
    const [ax, ay, az] = a;
    const across = 1 - dz * dz;
    const long = across > 1e-6;
    const top = az > b[2] ? a : b;
    const low = [0, 1].map((k) => Math.min(a[k], b[k]) - r);
    const high = [0, 1].map((k) => Math.max(a[k], b[k]) + r);
    const reach = (r * Math.sqrt(across)) / Math.abs(dy);
    let y = 0;
    const row = (at) => {
      y = at;
      if (Math.abs(dy) < 0.1) return [low[0], high[0]];
      const middle = ax + ((y - ay) * dx) / dy;
      return [Math.max(low[0], middle - reach), Math.min(high[0], middle + reach)];
    };
    // The nearest point on the tube of infinite length, or else on the ball at the end beyond which it is.
    this.each(low, high, colour, row, (column) => {
      let end = top;
      if (long) {
        const u = column + 0.5 - ax;
        const v = y - ay;
        const along = u * dx + v * dy;
        const half = -along * dz;
        const root = half * half - across * (u * u + v * v - along * along - r * r);
        if (root < 0) return false;
        const z = (Math.sqrt(root) - half) / across;
        const s = along + z * dz;
        if (s >= 0 && s <= l) {
          found[0] = az + z;
          found[1] = (u - s * dx) / r;
          found[2] = (v - s * dy) / r;
          found[3] = (z - s * dz) / r;
          return true;
        }
        end = s < 0 ? a : b;
      }
      const u = column + 0.5 - end[0];
      const v = y - end[1];
      const square = r * r - u * u - v * v;
      if (square < 0) return false;
      const z = Math.sqrt(square);
      found[0] = end[2] + z;
      found[1] = u / r;
      found[2] = v / r;
      found[3] = z / r;
      return true;
    });
  }

  box(c, sides, colour) {
    const {found} = this;
    const h = sides.map(length);
    // Unit vectors out of the sides that are seen.
    const axes = sides.map((side, i) => {
      const axis = h[i] > 0 ? side : cross(sides[(i + 1) % 3], sides[(i + 2) % 3]);
      return scaled(axis, (axis[2] < 0 ? -1 : 1) / (length(axis) || 1));
    });
    const [cx, cy, cz] = c;
    const reach = [0, 1].map((k) => axes.reduce((sum, axis, i) => sum + Math.abs(axis[k]) * h[i], 0));
    let y = 0;
    const row = (at) => {
      y = at;
      return [cx - reach[0], cx + reach[0]];
    };
    this.each([cx - reach[0], cy - reach[1]], [cx + reach[0], cy + reach[1]], colour, row, (column) => {
      let enter = -Infinity;
      let leave = Infinity;
      let side = 0;
      for (let i = 0; i < 3; ++i) {
        const axis = axes[i];
        const o = (column + 0.5 - cx) * axis[0] + (y - cy) * axis[1];
        if (axis[2] < 1e-9) {
          if (Math.abs(o) > h[i]) return false;
          continue;
        }
        const out = (h[i] - o) / axis[2];
        enter = Math.max(enter, (-h[i] - o) / axis[2]);
        if (out < leave) {
          leave = out;
          side = i;
        }
      }
      if (enter > leave) return false;
      const axis = axes[side];
      found[0] = cz + leave;
      found[1] = axis[0];
      found[2] = axis[1];
      found[3] = axis[2];
      return true;
    });
  }
}
