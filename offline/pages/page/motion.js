// The recorded motion as functions of time. Columns of the data are arrays over the samples.

class Motion {
  constructor(data) {
    this.data = data;
    this.times = data.times_s;
    this.first = this.times[0];
    this.last = this.times[this.times.length - 1];
    this.settles = this.last - data.duration_s > 1e-9;
    // Positive friction points along the surface with the normal on its left: +x on level ground.
    this.normal = data.forces.map((list) => list.reduce((sum, f) => sum + f.fx * f.nx + f.fz * f.nz, 0));
    this.friction = data.forces.map((list) => list.reduce((sum, f) => sum + f.fx * f.nz - f.fz * f.nx, 0));
  }

  clamp(t) {
    return Math.min(Math.max(t, this.first), this.last);
  }

  // The sample at or before t, and how far t is on the way to the next one, in [0, 1].
  locate(t) {
    let low = 0;
    let high = this.times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= t) low = middle;
      else high = middle;
    }
    const share = (t - this.times[low]) / (this.times[high] - this.times[low]);
    return [low, Math.min(Math.max(share, 0), 1)];
  }

  nearest(t) {
    const [i, share] = this.locate(t);
    return share < 0.5 ? i : i + 1;
  }

  value(column, t) {
    const [i, share] = this.locate(t);
    return column[i] + share * (column[i + 1] - column[i]);
  }

  // Of every link: [x, z, pitch].
  poses(t) {
    return this.data.links.map((link) => [link.x_m, link.z_m, link.pitch_rad].map((c) => this.value(c, t)));
  }

  posesOfSample(i) {
    return this.data.links.map((link) => [link.x_m[i], link.z_m[i], link.pitch_rad[i]]);
  }

  // The space the robot takes at these poses: [least x, least z, greatest x, greatest z].
  box(poses) {
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    this.data.links.forEach((link, k) => {
      const [x, z, pitch] = poses[k];
      const c = Math.cos(pitch);
      const s = Math.sin(pitch);
      for (const shape of link.shapes) {
        for (const [u, w] of shape.corners) {
          const px = x + c * u - s * w;
          const pz = z + s * u + c * w;
          box[0] = Math.min(box[0], px - shape.r);
          box[1] = Math.min(box[1], pz - shape.r);
          box[2] = Math.max(box[2], px + shape.r);
          box[3] = Math.max(box[3], pz + shape.r);
        }
      }
      box[0] = Math.min(box[0], x);
      box[1] = Math.min(box[1], z);
      box[2] = Math.max(box[2], x);
      box[3] = Math.max(box[3], z);
    });
    return box;
  }
}

// Numbers as text: a true minus sign, and always the same width for the same digits.

function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text.replace('-', '−');
}

function superscript(integer) {
  return String(integer).replace(/[-0-9]/g, (c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]));
}

// Four significant digits, in powers of ten where plain digits would be long.
function significant(value) {
  if (value === 0) return '0';
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent >= -3 && exponent < 5) return fixed(value, Math.max(0, 3 - exponent));
  return `${fixed(value / 10 ** exponent, 2)}×10${superscript(exponent)}`;
}
