// From where the plant is looked at. Matrices are column by column.

// Half of the field of view in perspective is 15 degrees, unless a model declares another.
const SLOPE = Math.tan(Math.PI / 12);

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

class Camera {
  // `size`: sides of the box around everything, whose middle is the origin; in scene units. `points`: those that are
  // outermost in some direction, over the whole recording.
  // `beyond`: how far from the origin something may be.
  constructor(size, points, beyond) {
    this.size = size;
    this.points = points;
    this.beyond = beyond;
    this.radius = Math.hypot(...size) / 2 || 1;
    this.perspective = true;
    this.look(0, 0);
  }

  // As a declared camera, whatever the plant does: `eye` and `aim` are points, `angle` is that of view across the smaller side (degrees).
  stand({ eye, aim, angle }) {
    const away = eye.map((x, i) => x - aim[i]);
    const distance = Math.hypot(...away);
    this.azimuth = (Math.atan2(away[0], away[2]) * 180) / Math.PI;
    this.elevation = (Math.atan2(away[1], Math.hypot(away[0], away[2])) * 180) / Math.PI;
    this.zoom = 1;
    this.target = aim;
    this.lens = { distance, slope: Math.tan((angle * Math.PI) / 360) };
  }

  // From a side, such that everything is seen; degrees.
  look(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.zoom = 1;
    this.lens = null;
    // Kept while the plant is turned, so that it does not change its size then.
    const [right, up, towards] = this.axes();
    // The middle of what is seen.
    const middle = [right, up].map((axis) => {
      const along = this.points.map((point) => dot(axis, point));
      return along.length ? (Math.min(...along) + Math.max(...along)) / 2 : 0;
    });
    this.target = [0, 1, 2].map((i) => right[i] * middle[0] + up[i] * middle[1]);
    this.fit = this.points.map((point) => [
      Math.abs(dot(right, point) - middle[0]),
      Math.abs(dot(up, point) - middle[1]),
      dot(towards, point),
    ]);
  }

  orbit(right, up) {
    this.azimuth -= right;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + up));
  }

  // Right, up and towards the viewer.
  axes() {
    const [a, e] = [this.azimuth, this.elevation].map((angle) => (angle * Math.PI) / 180);
    const towards = [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
    const right = [Math.cos(a), 0, -Math.sin(a)];
    const up = [-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)];
    return [right, up, towards];
  }

  // Half of the height that is seen at the distance 1.
  slope(aspect) {
    return this.lens ? this.lens.slope / Math.min(1, aspect) : SLOPE;
  }

  // Half of the height of the plane through the target that is seen, in scene units.
  reach(aspect) {
    if (this.lens) return (this.lens.distance * this.slope(aspect)) / this.zoom;
    // What is nearer than the target is seen larger.
    const slope = this.perspective ? SLOPE : 0;
    const needed = this.fit.reduce((most, [right, up, near]) => Math.max(most, Math.max(up, right / aspect) + near * slope), this.radius / 50);
    return (1.05 * needed) / this.zoom;
  }

  // Moves what is seen by parts of the height of the picture.
  pan(x, y, aspect) {
    const [right, up] = this.axes();
    const reach = 2 * this.reach(aspect);
    this.target = this.target.map((at, i) => at - (right[i] * x + up[i] * y) * reach);
  }

  // Makes things larger, keeping what is at this place (from the middle, in parts of the height) where it is.
  magnify(factor, x, y, aspect) {
    const before = this.zoom;
    this.zoom = Math.max(0.1, Math.min(1000, this.zoom * factor));
    const change = this.zoom / before;
    this.pan(x - x * change, y - y * change, aspect);
  }

  matrices(aspect) {
    const [right, up, towards] = this.axes();
    const reach = this.reach(aspect);
    const distance = reach / this.slope(aspect);
    const eye = (axis) => -axis.reduce((sum, x, i) => sum + x * this.target[i], 0);
    // Depth is counted from the target in the direction of the viewer, as in pictures.
    const view = [0, 1, 2].flatMap((i) => [right[i], up[i], towards[i], 0]);
    view.push(eye(right), eye(up), eye(towards), 1);
    const far = Math.max(this.radius, this.beyond) + Math.hypot(...this.target) + reach;
    let projection;
    if (this.perspective) {
      const [near, end] = [Math.max(distance - far, distance * 0.01), distance + far];
      const focus = distance / reach;
      const a = -(end + near) / (end - near), b = (-2 * end * near) / (end - near);
      projection = [focus / aspect, 0, 0, 0, 0, focus, 0, 0, 0, 0, a, -1, 0, 0, b - a * distance, distance];
    } else {
      projection = [1 / (reach * aspect), 0, 0, 0, 0, 1 / reach, 0, 0, 0, 0, -1 / far, 0, 0, 0, 0, 1];
    }
    const near = this.size.reduce((sum, side, i) => sum + (Math.abs(towards[i]) * side) / 2, 0) + eye(towards);
    return { view: new Float32Array(view), projection: new Float32Array(projection), near };
  }
}
