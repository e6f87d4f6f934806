// The recorded motion as functions of time. Columns of the data are arrays over the samples.

class Motion extends Times {
  constructor(data) {
    super(data.times_s);
    this.data = data;
    this.settles = this.last - data.duration_s > 1e-9;
    // Positive friction points along the surface with the normal on its left: +x on level ground.
    this.normal = data.forces.map((list) => list.reduce((sum, f) => sum + f.fx * f.nx + f.fz * f.nz, 0));
    this.friction = data.forces.map((list) => list.reduce((sum, f) => sum + f.fx * f.nz - f.fz * f.nx, 0));
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
