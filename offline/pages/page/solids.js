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
  }

  // Empty, but for planes z = a x + b y + c, which hide what is behind them.
  clear(planes) {
    this.planes = planes;
    this.pixels.fill(0);
    this.depth.fill(-Infinity);
  }

  // Calls hit(x, y) for the pixels of a rectangle. It returns the depth there, or NaN, and leaves the normal in `n`.
  each(low, high, colour, hit) {
    const {width, height, pixels, depth, planes} = this;
    const n = [0, 0, 1];
    const [left, right] = [Math.max(0, Math.floor(low[0])), Math.min(width - 1, Math.ceil(high[0]))];
    const [top, bottom] = [Math.max(0, Math.floor(height - high[1])), Math.min(height - 1, Math.ceil(height - low[1]))];
    const [red, green, blue] = colour;
    for (let row = top; row <= bottom; ++row) {
      const y = height - row - 0.5;
      for (let x = left, i = row * width + left; x <= right; ++x, ++i) {
        const z = hit(x + 0.5, y, n);
        if (!(z > depth[i]) || planes.some((p) => z < p[0] * (x + 0.5) + p[1] * y + p[2])) continue;
        depth[i] = z;
        const k = brightness(n[0], n[1], n[2]);
        pixels[i] = 0xff000000 | (Math.min(255, k * blue) << 16) | (Math.min(255, k * green) << 8) | Math.min(255, k * red);
      }
    }
  }

  tube(a, b, r, colour) {
    const l = length(add(b, a, -1));
    const d = l > 0 ? scaled(add(b, a, -1), 1 / l) : [0, 0, 1];
    const across = 1 - d[2] * d[2];
    const top = a[2] > b[2] ? a : b;
    // The nearest point on the tube of infinite length, or else on the ball at the end beyond which it is.
    this.each([Math.min(a[0], b[0]) - r, Math.min(a[1], b[1]) - r], [Math.max(a[0], b[0]) + r, Math.max(a[1], b[1]) + r], colour, (x, y, n) => {
      let end = top;
      if (across > 1e-6 && l > 0) {
        const [u, v] = [x - a[0], y - a[1]];
        const along = u * d[0] + v * d[1];
        const half = -along * d[2];
        const root = half * half - across * (u * u + v * v - along * along - r * r);
        if (root < 0) return NaN;
        const z = (Math.sqrt(root) - half) / across;
        const s = along + z * d[2];
        if (s >= 0 && s <= l) {
          n[0] = (u - s * d[0]) / r;
          n[1] = (v - s * d[1]) / r;
          n[2] = (z - s * d[2]) / r;
          return a[2] + z;
        }
        end = s < 0 ? a : b;
      }
      const [u, v] = [x - end[0], y - end[1]];
      const square = r * r - u * u - v * v;
      if (square < 0) return NaN;
      const z = Math.sqrt(square);
      n[0] = u / r;
      n[1] = v / r;
      n[2] = z / r;
      return end[2] + z;
    });
  }

  box(c, sides, colour) {
    const h = sides.map(length);
    const axes = sides.map((side, i) => (h[i] > 0 ? scaled(side, 1 / h[i]) : cross(sides[(i + 1) % 3], sides[(i + 2) % 3])));
    for (const [i, axis] of axes.entries()) axes[i] = scaled(axis, (axis[2] < 0 ? -1 : 1) / (length(axis) || 1));
    const reach = [0, 1].map((k) => axes.reduce((sum, axis, i) => sum + Math.abs(axis[k]) * h[i], 0));
    this.each([c[0] - reach[0], c[1] - reach[1]], [c[0] + reach[0], c[1] + reach[1]], colour, (x, y, n) => {
      let [enter, leave, side] = [-Infinity, Infinity, 0];
      for (let i = 0; i < 3; ++i) {
        const axis = axes[i];
        const o = (x - c[0]) * axis[0] + (y - c[1]) * axis[1];
        if (axis[2] < 1e-9) {
          if (Math.abs(o) > h[i]) return NaN;
          continue;
        }
        const out = (h[i] - o) / axis[2];
        enter = Math.max(enter, (-h[i] - o) / axis[2]);
        if (out < leave) [leave, side] = [out, i];
      }
      if (enter > leave) return NaN;
      [n[0], n[1], n[2]] = axes[side];
      return c[2] + leave;
    });
  }
}
