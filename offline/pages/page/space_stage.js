// The robot in space on a canvas: carpets with shadows, solids, forces. The view turns, comes nearer and follows.

const viewpoints = {corner: null, side: [0, 0], front: [90, 0], top: [0, 90]};  // azimuth, elevation [degrees]
const radians = (degrees) => (degrees * Math.PI) / 180;
const between = (low, value, high) => Math.min(Math.max(value, low), high);

// A rotation by a quaternion x, y, z, w of any length, as its columns.
function rotationOf([x, y, z, w]) {
  const k = 2 / (x * x + y * y + z * z + w * w);
  return [
    [1 - k * (y * y + z * z), k * (x * y + w * z), k * (x * z - w * y)],
    [k * (x * y - w * z), 1 - k * (x * x + z * z), k * (y * z + w * x)],
    [k * (x * z + w * y), k * (y * z - w * x), 1 - k * (x * x + y * y)],
  ];
}

const turned = (pose, v) => add(add(scaled(pose.axes[0], v[0]), pose.axes[1], v[1]), pose.axes[2], v[2]);
const placed = (pose, v) => add(turned(pose, v), pose.at);

// The motion: poses of bodies and contacts at any time.
class SpaceMotion extends Times {
  constructor(data) {
    super(data.times_s);
    this.data = data;
  }

  // Of every body: `at`, where its frame is, and `axes`, the columns of its rotation.
  poses(t) {
    const [i, share] = this.locate(t);
    const [from, to] = [this.data.poses[i], this.data.poses[i + 1]];
    return this.data.bodies.map((_, b) => {
      const [p, q] = [from, to].map((poses) => poses.slice(7 * b, 7 * b + 7).map((v) => v * 1e-4));
      const sign = p[3] * q[3] + p[4] * q[4] + p[5] * q[5] + p[6] * q[6] < 0 ? -1 : 1;
      const mixed = p.map((v, k) => (1 - share) * v + share * (k < 3 ? 1 : sign) * q[k]);
      return {at: mixed.slice(0, 3), axes: rotationOf(mixed.slice(3))};
    });
  }

  // Of the nearest frame: [{at, force}].
  contacts(t) {
    const list = this.data.contacts[this.nearest(t)];
    return Array.from({length: list.length / 6}, (_, k) => ({
      at: list.slice(6 * k, 6 * k + 3).map((v) => v * 1e-4),
      force: list.slice(6 * k + 3, 6 * k + 6).map((v) => v * 0.1),
    }));
  }

  root(t) {
    const [i, share] = this.locate(t);
    return [0, 1, 2].map((k) => 1e-4 * ((1 - share) * this.data.poses[i][k] + share * this.data.poses[i + 1][k]));
  }
}

function colourOf(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}

// The corners of the convex hull of points in the plane.
function hullOf(points) {
  const sorted = [...points].sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const half = (list) => {
    const hull = [];
    for (const p of list) {
      while (hull.length > 1) {
        const [a, b] = hull.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 1e-12) break;
        hull.pop();
      }
      hull.push(p);
    }
    hull.pop();
    return hull;
  };
  return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}

// Pixels that are computed for one of the window's, in each direction.
const sharpest = () => Math.max(2, window.devicePixelRatio || 1);

class SpaceStage {
  constructor(canvas, motion) {
    this.canvas = canvas;
    this.motion = motion;
    this.data = motion.data;
    this.zoom = 1;
    this.ends = false;
    this.slow = 0;  // frames in a row that took long
    this.sharpness = sharpest();
    viewpoints.corner = this.data.from_deg;
    [this.azimuth, this.elevation] = viewpoints.corner;
    const solid = (body) => body.shapes.flatMap((shape) => {
      const corners = cornersOf(partsOf({...shape, r: 0})[0]);
      return {r: shape.r, corners, parts: partsOf(shape), colour: colourOf(body.colour)};
    });
    this.bodies = this.data.bodies.map(solid);
    this.obstacles = this.data.obstacles.flatMap(solid);
    const {extent_m: [low, high], reach_m} = this.data;
    // A motion that goes far is followed.
    this.camera = [0, 1].some((k) => high[k] - low[k] > 6 * reach_m[k]) ? 'follow' : 'fit';
    this.trace = this.data.poses.map((poses) => poses.slice(0, 3).map((v) => v * 1e-4));
  }

  layout(width, height) {
    this.width = width;
    this.height = height;
    const ratio = this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.fit();
  }

  // The size at which what the camera shows fills the picture, as seen from here.
  fit() {
    this.aim();
    const {extent_m: [low, high], reach_m} = this.data;
    const half = this.camera === 'fit' ? scaled(add(high, low, -1), 0.5) : reach_m;
    const [u, v] = [this.right, this.up].map((axis) => axis.reduce((sum, a, k) => sum + Math.abs(a) * half[k], 1e-6));
    this.fitted = 0.86 * Math.min(this.width / (2 * u), this.height / (2 * v));
  }

  aim() {
    const [a, e] = [radians(this.azimuth), radians(this.elevation)];
    const [sa, ca, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
    this.right = [ca, sa, 0];
    this.up = [-se * sa, se * ca, ce];
    this.toward = [ce * sa, -ce * ca, se];
  }

  look(azimuth, elevation) {
    this.azimuth = ((azimuth % 360) + 540) % 360 - 180;
    this.elevation = between(0, elevation, 90);
    this.aim();
  }

  // Right, up and towards the viewer, in metres.
  turn(v) {
    return [dot(this.right, v), dot(this.up, v), dot(this.toward, v)];
  }

  // From a point of the world to the window's pixels.
  at(point) {
    const [x, y] = this.turn(add(point, this.target, -1));
    return [this.width / 2 + this.scale * x, this.height / 2 - this.scale * y];
  }

  // @param sharp  whatever time it takes.
  draw(t, sharp = false) {
    const {motion, data} = this;
    this.dense = Math.min(sharp ? sharpest() : this.sharpness, Math.sqrt(3e6 / (this.width * this.height)));
    const {extent_m: [low, high]} = data;
    this.scale = this.fitted * this.zoom;
    this.target = scaled(add(low, high), 0.5);
    if (this.camera === 'follow') {
      const root = motion.root(t);
      this.target = [root[0], root[1], (this.target[2] + root[2]) / 2];
    }
    const style = getComputedStyle(this.canvas);
    this.colour = (name) => style.getPropertyValue(name).trim();
    const g = this.g = this.canvas.getContext('2d');
    g.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    g.clearRect(0, 0, this.width, this.height);
    const poses = motion.poses(t);
    for (const carpet of data.carpets) this.drawCarpet(carpet, poses);
    this.drawTrace(t);
    if (this.ends) {
      for (const end of [motion.first, motion.clamp(data.motion_s)]) this.drawSolids(motion.poses(end), [], 0.28);
    }
    const started = performance.now();
    this.drawSolids(poses, this.obstacles, 1);
    // A slow machine has fewer pixels.
    this.slow = !sharp && performance.now() - started > 30 ? this.slow + 1 : 0;
    if (this.slow > 8) [this.sharpness, this.slow] = [Math.max(1, 0.7 * this.sharpness), 0];
    this.drawForces(motion.contacts(t));
    this.drawAxes();
  }

  drawCarpet(carpet, poses) {
    const {g, data} = this;
    const origin = this.at(carpet.origin);
    const [s, t] = [carpet.along_s, carpet.along_t].map((v) => this.turn(v).map((c) => c * this.scale));
    g.save();
    g.transform(s[0], -s[1], t[0], -t[1], ...origin);
    const size = [carpet.s[1] - carpet.s[0], carpet.t[1] - carpet.t[0]];
    g.beginPath();
    for (const [k, corner] of carpet.outline.entries()) {
      if (k === 0) g.moveTo(...corner); else g.lineTo(...corner);
    }
    g.clip();
    // Of its back there is the grid alone.
    const front = dot(carpet.normal, this.toward) > 0;
    g.fillStyle = this.colour('--carpet');
    if (front) g.fill();
    if (carpet.ground && front) {
      g.fillStyle = g.strokeStyle = this.colour('--shadow');
      g.lineJoin = g.lineCap = 'round';
      const fixed = {at: [0, 0, 0], axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]};
      this.obstacles.forEach((solid) => this.drawShadow(solid, fixed));
      this.bodies.forEach((solids, b) => solids.forEach((solid) => this.drawShadow(solid, poses[b])));
    }
    g.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    g.beginPath();
    const line = (from, to) => {
      for (const [k, [x, y]] of [from, to].entries()) {
        const p = this.at(add(add(carpet.origin, carpet.along_s, x), carpet.along_t, y));
        if (k === 0) g.moveTo(...p); else g.lineTo(...p);
      }
    };
    const step = data.step_m;
    for (let k = 0; k <= size[0] / step + 0.5; ++k) line([carpet.s[0] + k * step, carpet.t[0]], [carpet.s[0] + k * step, carpet.t[1]]);
    for (let k = 0; k <= size[1] / step + 0.5; ++k) line([carpet.s[0], carpet.t[0] + k * step], [carpet.s[1], carpet.t[0] + k * step]);
    g.strokeStyle = this.colour('--grid-line');
    g.globalAlpha = 0.35;
    g.lineWidth = 1;
    g.stroke();
    g.restore();
  }

  drawShadow(solid, pose) {
    const {g} = this;
    const points = solid.corners.map((corner) => placed(pose, corner));
    g.beginPath();
    for (const [k, p] of hullOf(points).entries()) {
      if (k === 0) g.moveTo(p[0], p[1]); else g.lineTo(p[0], p[1]);
    }
    g.closePath();
    g.fill();
    g.lineWidth = 2 * solid.r;
    if (solid.r === 0) return;
    if (points.length === 1) {
      g.beginPath();
      g.arc(points[0][0], points[0][1], solid.r, 0, 7);
      g.fill();
    } else {
      g.stroke();
    }
  }

  // The path of the root until now, and from now on.
  drawTrace(t) {
    const {g, trace, motion} = this;
    const now = motion.nearest(t);
    for (const [points, dash] of [[trace.slice(0, now + 1), []], [trace.slice(now), [2, 3]]]) {
      g.beginPath();
      points.forEach((p, k) => (k === 0 ? g.moveTo(...this.at(p)) : g.lineTo(...this.at(p))));
      g.setLineDash(dash);
      g.strokeStyle = this.colour(dash.length > 0 ? '--faint' : '--root');
      g.lineWidth = 1.6;
      g.stroke();
    }
    g.setLineDash([]);
  }

  drawSolids(poses, obstacles, opacity) {
    const {width, height, data, dense} = this;
    const [w, h] = [Math.round(width * dense), Math.round(height * dense)];
    if (!this.picture || this.picture.width !== w || this.picture.height !== h) {
      this.picture = new SolidPicture(w, h);
      this.layer = Object.assign(document.createElement('canvas'), {width: w, height: h});
    }
    const {picture} = this;
    const k = this.scale * dense;
    const seen = (v) => {
      const p = this.turn(add(v, this.target, -1));
      return [w / 2 + k * p[0], h / 2 + k * p[1], k * p[2]];
    };
    // Of a carpet n . (p - o) = 0 in these coordinates.
    const planes = data.carpets.map((carpet) => [this.turn(carpet.normal), seen(carpet.origin)])
      .filter(([n]) => n[2] > 1e-3).map(([n, o]) => [-n[0] / n[2], -n[1] / n[2], dot(n, o) / n[2]]);
    picture.clear(planes);
    const draw = (part, colour, point, vector) => {
      if (part.a) picture.tube(seen(point(part.a)), seen(point(part.b)), k * part.r, colour);
      else picture.box(seen(point(part.c)), part.sides.map((side) => this.turn(vector(side)).map((c) => k * c)), colour);
    };
    for (const solid of obstacles) solid.parts.forEach((part) => draw(part, solid.colour, (v) => v, (v) => v));
    this.bodies.forEach((solids, b) => {
      for (const solid of solids) solid.parts.forEach((part) => draw(part, solid.colour, (v) => placed(poses[b], v), (v) => turned(poses[b], v)));
    });
    this.layer.getContext('2d').putImageData(picture.image, 0, 0);
    this.g.globalAlpha = opacity;
    this.g.imageSmoothingQuality = 'high';
    this.g.drawImage(this.layer, 0, 0, width, height);
    this.g.globalAlpha = 1;
  }

  drawForces(contacts) {
    const {g} = this;
    g.strokeStyle = g.fillStyle = this.colour('--normal');
    for (const {at, force} of contacts) {
      const from = this.at(at);
      this.arrow(from, this.at(add(at, force, this.data.m_per_n)), 2.4, 8);
      g.beginPath();
      g.arc(...from, 2.6, 0, 7);
      g.fill();
    }
  }

  arrow(from, to, width, head) {
    const {g} = this;
    const [x, y] = [to[0] - from[0], to[1] - from[1]];
    const l = Math.hypot(x, y);
    if (l < 1) return;
    const size = Math.min(head, 0.7 * l);
    const [c, s] = [(x / l) * size, (y / l) * size];
    g.lineWidth = width;
    g.beginPath();
    g.moveTo(...from);
    g.lineTo(to[0] - 0.8 * c, to[1] - 0.8 * s);
    g.stroke();
    g.beginPath();
    g.moveTo(...to);
    g.lineTo(to[0] - c + 0.45 * s, to[1] - s - 0.45 * c);
    g.lineTo(to[0] - c - 0.45 * s, to[1] - s + 0.45 * c);
    g.fill();
  }

  // The world's axes in the lower left corner.
  drawAxes() {
    const {g} = this;
    const middle = [42, this.height - 40];
    g.font = '11px system-ui, sans-serif';
    g.textAlign = 'center';
    g.textBaseline = 'middle';
    g.strokeStyle = g.fillStyle = this.colour('--muted');
    ['x', 'y', 'z'].forEach((name, i) => {
      const [x, y] = this.turn([0, 1, 2].map((k) => (k === i ? 1 : 0)));
      if (Math.hypot(x, y) < 0.12) return;
      this.arrow(middle, [middle[0] + 24 * x, middle[1] - 24 * y], 1.2, 6);
      g.fillText(name, middle[0] + 34 * x, middle[1] - 34 * y);
    });
  }
}
