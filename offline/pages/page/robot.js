// Drawing the robot and its surroundings. Bodies are drawn in metres inside a group that turns z up; arrows and
// text are drawn in pixels.

// The colour class of a link: that of the joint that moves it, which its curves share; none for the root.
function linkClass(data, index) {
  const joint = data.joints.findIndex((j) => j.link === index);
  return joint < 0 ? 'hue-root' : `hue-${joint % 8}`;
}

// The robot as one group of SVG that can be put into a pose.
class RobotDrawing {
  constructor(parent, data) {
    this.group = element('g', {class: 'robot'}, parent);
    this.hinge = [];
    // The root is drawn last: so the legs of a tumbler seem to run beside it, and its hinges lie on
    // top.
    const order = data.links.map((_, k) => k).reverse();
    this.links = [];
    for (const k of order) {
      const group = element('g', {class: linkClass(data, k)}, this.group);
      element('title', {}, group, data.links[k].name);
      const light = data.links[k].shapes.filter((s) => !s.collides);
      const dark = data.links[k].shapes.filter((s) => s.collides);
      for (const shape of light) element('path', {class: 'light', d: outlinePath(shape.corners, shape.r)}, group);
      for (const shape of dark) element('path', {class: 'dark', d: outlinePath(shape.corners, shape.r)}, group);
      this.links[k] = group;
    }
    for (const joint of data.joints) {
      const radius = 0.3 * Math.max(0.02, ...data.links[joint.link].shapes.map((s) => (s.collides ? 0 : s.r)));
      this.hinge.push([joint.link, element('circle', {class: 'hinge', r: radius}, this.group)]);
    }
  }

  set(poses) {
    poses.forEach(([x, z, pitch], k) => {
      this.links[k].setAttribute('transform', `translate(${x} ${z}) rotate(${(pitch * 180) / Math.PI})`);
    });
    for (const [link, circle] of this.hinge) {
      circle.setAttribute('cx', poses[link][0]);
      circle.setAttribute('cy', poses[link][1]);
    }
  }
}

// The path around a convex polygon, its corners counter-clockwise in x and z, with a radius swept around it.
function outlinePath(corners, r) {
  const arc = (x, z) => `A${r} ${r} 0 0 1 ${x} ${z}`;
  if (corners.length === 1) {
    const [x, z] = corners[0];
    return `M${x - r} ${z}${arc(x + r, z)}${arc(x - r, z)}z`;
  }
  // From a side of the polygon out to the outline.
  const out = corners.map(([x, z], k) => {
    const [toX, toZ] = corners[(k + 1) % corners.length];
    const length = Math.hypot(toX - x, toZ - z);
    return [(r * (toZ - z)) / length, (-r * (toX - x)) / length];
  });
  const points = corners.map(([x, z], k) => {
    const [before, after] = [out[(k || corners.length) - 1], out[k]];
    return `${x + before[0]} ${z + before[1]}${r > 0 ? arc(x + after[0], z + after[1]) : ''}`;
  });
  return `M${points.join('L')}z`;
}

function drawObstacles(parent, data) {
  for (const o of data.obstacles) {
    const shape = element('path', {class: 'obstacle', d: outlinePath(o.corners, o.r)}, parent);
    element('title', {}, shape, o.name);
  }
}

function niceBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [5, 2, 1].find((k) => k * power <= value * (1 + 1e-9));
}

// The large picture: surroundings, trace of the root, robot and contact forces, with a camera.
// `others`: further motions of the same robot, [{motion, hue}], drawn as outlines over it.
class Stage {
  constructor(svg, motion, ghosts, others = []) {
    this.svg = svg;
    this.motion = motion;
    const data = motion.data;
    this.world = element('g', {}, svg);
    drawObstacles(this.world, data);
    // A trail of faint earlier poses, those of the strip.
    this.trail = true;
    this.ghosts = Array.from({length: ghosts}, (_, k) => {
      const t = motion.first + (k / Math.max(1, ghosts - 1)) * (motion.clamp(data.duration_s) - motion.first);
      const ghost = new RobotDrawing(this.world, data);
      ghost.group.classList.add('ghost');
      ghost.set(motion.poses(t));
      return [t, ghost.group];
    });
    const path = data.links[0].x_m.map((x, i) => `${x} ${data.links[0].z_m[i]}`);
    this.path = path;
    element('path', {class: 'trace', d: `M${path.join('L')}`}, this.world);
    this.traced = element('path', {class: 'trace done'}, this.world);
    this.robot = new RobotDrawing(this.world, data);
    this.others = others.map((other) => {
      const drawing = new RobotDrawing(this.world, other.motion.data);
      drawing.group.setAttribute('class', `robot outline ${other.hue}`);
      return [other.motion, drawing];
    });
    this.ruler = element('g', {class: 'ruler'}, svg);
    this.arrows = element('g', {class: 'arrows'}, svg);
    this.overlay = element('g', {class: 'overlay'}, svg);

    const boxes = [motion, ...others.map((other) => other.motion)]
      .flatMap((m) => m.times.map((_, i) => m.box(m.posesOfSample(i))));
    this.ground = data.ground_z;  // undefined without level ground
    this.bounds = [0, 1, 2, 3].map((c) => {
      const side = boxes.map((b) => b[c]);
      return c < 2 ? side.reduce((a, b) => Math.min(a, b)) : side.reduce((a, b) => Math.max(a, b));
    });
    this.reach = boxes.reduce((most, b) => Math.max(most, b[2] - b[0], b[3] - b[1]), 0);
    this.camera = this.bounds[2] - this.bounds[0] > 3 * this.reach ? 'follow' : 'fit';

    // A following camera that does not shake: the root's x averaged over half a second.
    const x = data.links[0].x_m;
    this.followed = motion.times.map((t) => {
      const from = motion.nearest(motion.clamp(t - 0.25));
      const to = motion.nearest(motion.clamp(t + 0.25));
      return x.slice(from, to + 1).reduce((a, b) => a + b, 0) / (to + 1 - from);
    });

    // Arrows: nine in ten are at most a quarter of the robot's reach; a longer one (an impact) is cut and says its force.
    const sizes = data.forces.flat().map((f) => Math.hypot(f.fx, f.fz)).sort((a, b) => a - b);
    const typical = sizes[Math.floor(0.9 * sizes.length)] || 1;
    this.metresPerNewton = (0.25 * this.reach) / typical;
    this.longest = 0.5 * this.reach;
  }

  layout(width, height, large) {
    this.width = width;
    this.height = height;
    this.large = large;
    this.svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    this.overlay.replaceChildren();
    const font = large ? 15 : 11.5;
    this.svg.style.fontSize = `${font}px`;
    const [x0, z0, x1, z1] = this.bounds;
    const bottom = Math.min(z0, this.ground ?? z0);
    const below = 3.6 * font;
    const wide = this.camera === 'fit' ? x1 - x0 : this.reach;
    this.scale = Math.min((width * 0.9) / wide, (height * 0.9 - below) / (z1 - bottom));
    this.floor = height - below + bottom * this.scale;

    // The legend of the arrows, as long as the same force is in the picture.
    const newtons = niceBelow(70 / this.scale / this.metresPerNewton);
    const length = newtons * this.metresPerNewton * this.scale;
    if (this.motion.data.forces.some((list) => list.length > 0)) {
      const right = width - 1.4 * font;
      this.arrow(this.overlay, right - length, 1.9 * font, length, 0);
      element('text', {x: right - length - 0.7 * font, y: 2.25 * font, class: 'end'}, this.overlay, `${newtons} N`);
    }
    this.clock = large ? element('text', {x: 1.4 * font, y: 2.3 * font, class: 'clock'}, this.overlay) : null;
  }

  arrow(parent, x, y, dx, dy) {
    const length = Math.hypot(dx, dy);
    if (length < 1.5) return;
    const k = this.large ? 1.4 : 1;
    const head = Math.min(8 * k, length);
    const [ux, uy] = [dx / length, dy / length];
    const [bx, by] = [x + dx - ux * head, y + dy - uy * head];
    const w = 0.45 * head;
    element('path', {class: 'shaft', d: `M${x} ${y}L${bx} ${by}`, 'stroke-width': 2 * k}, parent);
    element('path', {class: 'head', d: `M${x + dx} ${y + dy}L${bx - uy * w} ${by + ux * w}L${bx + uy * w} ${by - ux * w}z`}, parent);
  }

  // `othersAt` is the time of the other motions where the first does not reach it.
  draw(t, othersAt = t) {
    const {motion, scale, floor} = this;
    const middle = this.camera === 'fit' ? (this.bounds[0] + this.bounds[2]) / 2 : motion.value(this.followed, t);
    const left = this.width / 2 - middle * scale;
    this.world.setAttribute('transform', `matrix(${scale} 0 0 ${-scale} ${left} ${floor})`);
    const poses = motion.poses(t);
    this.robot.set(poses);
    for (const [other, drawing] of this.others) drawing.set(other.poses(other.clamp(othersAt)));
    for (const [time, group] of this.ghosts) {
      const age = (t - time) / (motion.last - motion.first);
      group.style.display = this.trail && age > 0.03 ? '' : 'none';
      group.style.setProperty('--strength', `${Math.round(32 - 22 * age)}%`);
    }
    const [i] = motion.locate(t);
    this.traced.setAttribute('d', `M${this.path.slice(0, i + 1).join('L')}L${poses[0][0]} ${poses[0][1]}`);

    this.arrows.replaceChildren();
    for (const f of motion.data.forces[motion.nearest(t)]) {
      const size = Math.hypot(f.fx, f.fz);
      const shown = Math.min(size * this.metresPerNewton, this.longest) * scale;
      const [x, y] = [left + f.x * scale, floor - f.z * scale];
      const [dx, dy] = [(f.fx / (size || 1)) * shown, (-f.fz / (size || 1)) * shown];
      this.arrow(this.arrows, x, y, dx, dy);
      if (size * this.metresPerNewton > this.longest) {
        element('text', {x: x + dx + 8, y: y + dy + 4}, this.arrows, `${fixed(size, 0)} N`);
      }
    }
    this.drawRuler(left);
    if (this.clock) this.clock.textContent = `${fixed(othersAt, 3)} s`;
  }

  // Marks on level ground every 0.1 m, numbers as far apart as they need.
  drawRuler(left) {
    if (this.ground === undefined) return;
    this.ruler.replaceChildren();
    const y = this.floor - this.ground * this.scale;
    const font = parseFloat(this.svg.style.fontSize);
    const mark = this.scale * 0.1 >= 14 ? 0.1 : niceBelow(60 / this.scale) || 1;
    const number = [1, 2, 5, 10].map((k) => k * mark).find((d) => d * this.scale >= 7 * font) || 10 * mark;
    const every = Math.round(number / mark);
    const digits = Math.max(0, -Math.floor(Math.log10(number) + 1e-9));
    for (let k = Math.ceil(-left / this.scale / mark); k * mark * this.scale + left <= this.width; ++k) {
      const x = left + k * mark * this.scale;
      const numbered = k % every === 0;
      element('line', {x1: x, x2: x, y1: y, y2: y + font * (numbered ? 0.55 : 0.3)}, this.ruler);
      if (numbered && x > 2 * font && x < this.width - 3 * font) {
        element('text', {x, y: y + font * 1.75}, this.ruler, fixed(k * mark, digits) + (k === 0 ? ' m' : ''));
      }
    }
  }
}

// One pose in a picture of its own; all pictures of a strip have the same size and scale.
function drawPose(parent, motion, t, width, height, bottom) {
  const poses = motion.poses(t);
  const box = motion.box(poses);
  const x = (box[0] + box[2]) / 2;
  // In millimetres: browsers round sizes of a viewBox in metres.
  const svg = element('svg', {viewBox: `${-500 * width} 0 ${1000 * width} ${1000 * height}`, 'aria-hidden': 'true'}, parent);
  const world = element('g', {transform: `matrix(1000 0 0 -1000 ${-1000 * x} ${1000 * (height + bottom)})`}, svg);
  drawObstacles(world, motion.data);
  new RobotDrawing(world, motion.data).set(poses);
}
