// What is to be seen at a time as triangles, made here: corners in one array, to be drawn in one go. That suits programs that
// stand in for a graphics processor as well as real ones, and looking from elsewhere needs nothing new.

// Numbers of a corner: place, normal, and its colour in four bytes; and, where there are pictures, its place in one, and which.
const CORNER = 7;
const PIN = 3;
// A patch has at most so many pieces to a side, as a power of two.
const FINEST = 4;

class Geometry {
  constructor(recording) {
    this.recording = recording;
    this.palette = recording.palette.map((hex) => bytesOf(parseInt(hex.slice(1), 16)));
    this.outlines = recording.outlines.map(tubeForm);
    this.hasPictures = recording.pictures.length > 0;
    this.meshes = recording.meshes.map(({ places, normals, colors, triangles, picture, pinned, corners }) => ({
      picture,
      corners: Uint32Array.from(corners),
      pinned: Float32Array.from(pinned),
      places: Float32Array.from(places),
      normals: Float32Array.from(normals),
      colors: Uint32Array.from(colors, (color) => bytesOf(color < 0 ? -color - 1 : color)),
      tinted: colors.map((color) => color < 0),
      triangles: Uint32Array.from(triangles.flat()),
    }));
    this.grids = Array.from({ length: FINEST + 1 }, (_, log2) => gridOf(2 ** log2));
    this.cuts = recording.cuts.map((cut) => Uint32Array.from(cut.flat()));
    this.corners = new Float32Array(CORNER * 4096);
    this.colors = new Uint32Array(this.corners.buffer);
    this.pins = new Float32Array(this.hasPictures ? PIN * 4096 : 0);
    this.triangles = new Uint32Array(3 * 4096);
    this.net = new Float32Array(64);
    this.normals = new Float32Array(64);
    this.levels = new Uint8Array(8);
    this.column = new Float64Array(24);
  }

  // Takes in what is to be seen at a place between frames. `detail`: one in the distance that patches may have from their
  // surfaces, in units of length.
  stage(frame, detail) {
    const now = Math.floor(frame);
    // A chord over 1/n of a cubic is 6/8 of its second difference over n² away from it.
    this.fineness = 0.75 * detail;
    this.count = this.used = 0;
    for (const track of this.recording.tracks) {
      if (track.first > now) break;
      if (track.last < now) continue;
      const look = lookAt(track, now);
      const color = look.material < 0 ? 0 : this.palette[look.material];
      // The fourth byte says whether light comes through: not through stems and ground.
      this.mask = track.kind === 0 || isGround(track) ? 0xffffff : -1;
      if (this.net.length < track.width) this.net = new Float32Array(2 * track.width);
      placeAt(track, frame, this.net, 0);
      if (track.kind === 0) this.addStem(this.outlines[track.detail], look.variant, color);
      else if (track.kind === 1) this.addMesh(this.meshes[track.detail], color, look.material < 0);
      else if (track.kind === 2) this.addPatch(color);
      else if (track.kind === NET) this.addNet(this.meshes[track.detail], color, look.material < 0, track.width);
      else if (track.kind === 4) this.addMesh(this.meshes[track.detail], color, look.material < 0, true);
      else this.addPolygon(track.detail, this.cuts[look.variant], color);
    }
  }

  // Makes room, and takes these triangles of corners that are about to be added.
  begin(corners, triangles) {
    const floats = CORNER * (this.count + corners);
    if (floats > this.corners.length) {
      const more = new Float32Array(2 * floats);
      more.set(this.corners);
      this.corners = more;
      this.colors = new Uint32Array(more.buffer);
    }
    if (this.used + triangles.length > this.triangles.length) {
      const more = new Uint32Array(2 * (this.used + triangles.length));
      more.set(this.triangles);
      this.triangles = more;
    }
    const { count, used } = this;
    if (this.hasPictures) {
      const pins = PIN * (count + corners);
      if (pins > this.pins.length) {
        const more = new Float32Array(2 * pins);
        more.set(this.pins);
        this.pins = more;
      }
      this.pins.fill(-1, PIN * count, pins);
    }
    for (let i = 0; i < triangles.length; i++) this.triangles[used + i] = count + triangles[i];
    this.used += triangles.length;
    this.count += corners;
    return CORNER * count;
  }

  put(at, x, y, z, nx, ny, nz, color) {
    const { corners } = this;
    corners[at] = x;
    corners[at + 1] = y;
    corners[at + 2] = z;
    corners[at + 3] = nx;
    corners[at + 4] = ny;
    corners[at + 5] = nz;
    this.colors[at + 6] = color & this.mask;
  }

  // A length of a stem between two cross-sections: centre, u, v; see export/lengths.rs.
  addStem(form, variant, color) {
    const { net } = this;
    const apart = [net[9] - net[0], net[10] - net[1], net[11] - net[2]];
    const ahead = direction(apart, [0, 1, 0]);
    // Directions at both ends: where a stem ends in a point, those of the other end.
    const ends = [0, 9].map((end) => {
      const from = net[end + 3] || net[end + 4] || net[end + 5] ? end : 9 - end;
      const u = direction([net[from + 3], net[from + 4], net[from + 5]], [0, 0, 0]);
      const v = direction([net[from + 6], net[from + 7], net[from + 8]], [0, 0, 0]);
      return { at: end, u, v, along: direction(cross(u, v), ahead), radius: Math.hypot(net[end + 3], net[end + 4], net[end + 5]) };
    });
    this.addSide(form, ends, Math.hypot(...apart), color);
    if (variant & 1) this.addCap(form, ends[0], -1, color);
    if (variant & 2) this.addCap(form, ends[1], 1, color);
  }

  addSide({ spokes, side }, ends, length, color) {
    const { net } = this;
    let at = this.begin((2 * spokes.length) / 4, side);
    for (const { at: end, u, v, along } of ends) {
      for (let i = 0; i < spokes.length; i += 4, at += CORNER) {
        const x = spokes[i], y = spokes[i + 1], p = spokes[i + 2], q = spokes[i + 3];
        const around = [v[0] * p - u[0] * q, v[1] * p - u[1] * q, v[2] * p - u[2] * q];
        // At a right angle to the outline and to the side, which tapers.
        const tapered = [0, 0, 0];
        for (let k = 0; k < 3; k++) {
          tapered[k] = along[k] * length + (net[12 + k] - net[3 + k]) * x + (net[15 + k] - net[6 + k]) * y;
        }
        const n = direction(cross(around, tapered), along);
        const out = [0, 0, 0];
        for (let k = 0; k < 3; k++) out[k] = net[end + k] + net[end + 3 + k] * x + net[end + 6 + k] * y;
        this.put(at, out[0], out[1], out[2], n[0], n[1], n[2], color);
      }
    }
  }

  // The dome at an end, which looks along the stem (1) or back (-1).
  addCap({ spokes, latitudes, caps }, { at: end, u, v, along, radius }, outwards, color) {
    const { net } = this;
    let at = this.begin((latitudes.length * spokes.length) / 4, caps[outwards < 0 ? 0 : 1]);
    for (const [sin, cos] of latitudes) {
      for (let i = 0; i < spokes.length; i += 4, at += CORNER) {
        const x = spokes[i], y = spokes[i + 1], p = spokes[i + 2], q = spokes[i + 3];
        const around = direction([v[0] * p - u[0] * q, v[1] * p - u[1] * q, v[2] * p - u[2] * q], [1, 0, 0]);
        const n = cross(around, along);
        for (let k = 0; k < 3; k++) n[k] = n[k] * cos + along[k] * outwards * sin;
        const out = [0, 0, 0];
        for (let k = 0; k < 3; k++) {
          out[k] = net[end + k] + (net[end + 3 + k] * x + net[end + 6 + k] * y) * cos + along[k] * outwards * sin * radius;
        }
        this.put(at, out[0], out[1], out[2], n[0], n[1], n[2], color);
      }
    }
  }

  // Its third axis is the product of the others, unless it has a size of its own.
  addMesh({ places, normals, colors, tinted, triangles, picture, pinned }, color, plain, stretched = false) {
    const [ox, oy, oz, ax, ay, az, bx, by, bz] = this.net;
    const inverse = (x, y, z) => 1 / (x * x + y * y + z * z || Infinity);
    const each = Math.sqrt(inverse(ax, ay, az));
    const [cx, cy, cz] = stretched
      ? this.net.subarray(9, 12)
      : [(ay * bz - az * by) * each, (az * bx - ax * bz) * each, (ax * by - ay * bx) * each];
    // Normals follow the inverse of the scales.
    const [ea, eb, ec] = stretched
      ? [inverse(ax, ay, az), inverse(bx, by, bz), inverse(cx, cy, cz)]
      : [each, each, each];
    let at = this.begin(colors.length, triangles);
    this.pin(picture, pinned);
    for (let i = 0; i < colors.length; i++, at += CORNER) {
      const [x, y, z] = [places[3 * i], places[3 * i + 1], places[3 * i + 2]];
      const [p, q, r] = [normals[3 * i] * ea, normals[3 * i + 1] * eb, normals[3 * i + 2] * ec];
      this.put(
        at,
        ox + ax * x + bx * y + cx * z,
        oy + ay * x + by * y + cy * z,
        oz + az * x + bz * y + cz * z,
        ax * p + bx * q + cx * r,
        ay * p + by * q + cy * r,
        az * p + bz * q + cz * r,
        plain || !tinted[i] ? colors[i] : color,
      );
    }
  }

  // A mesh whose corners are where the numbers say; its normals are means of those of its faces, weighted by area.
  addNet({ colors, tinted, triangles, corners, picture, pinned }, color, plain, width) {
    const { net } = this;
    if (this.normals.length < width) this.normals = new Float32Array(2 * width);
    const { normals } = this;
    normals.fill(0, 0, width);
    for (let i = 0; i < triangles.length; i += 3) {
      const [p, q, r] = [3 * corners[triangles[i]], 3 * corners[triangles[i + 1]], 3 * corners[triangles[i + 2]]];
      const ax = net[q] - net[p], ay = net[q + 1] - net[p + 1], az = net[q + 2] - net[p + 2];
      const bx = net[r] - net[p], by = net[r + 1] - net[p + 1], bz = net[r + 2] - net[p + 2];
      const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
      for (const corner of [p, q, r]) {
        normals[corner] += x;
        normals[corner + 1] += y;
        normals[corner + 2] += z;
      }
    }
    let at = this.begin(colors.length, triangles);
    this.pin(picture, pinned);
    for (let i = 0; i < colors.length; i++, at += CORNER) {
      const k = 3 * corners[i];
      const [x, y, z] = [normals[k], normals[k + 1], normals[k + 2]];
      const each = 1 / (Math.sqrt(x * x + y * y + z * z) || 1);
      this.put(at, net[k], net[k + 1], net[k + 2], x * each, y * each, z * each, plain || !tinted[i] ? colors[i] : color);
    }
  }

  // Where the corners that were added last lie in a picture, if there is one.
  pin(picture, pinned) {
    if (picture === null) return;
    const { repeats } = this.recording.pictures[picture];
    for (let i = 0, pin = PIN * this.count - (PIN * pinned.length) / 2; i < pinned.length; i += 2, pin += PIN) {
      this.pins[pin] = pinned[i];
      this.pins[pin + 1] = pinned[i + 1];
      this.pins[pin + 2] = 2 * picture + (repeats ? 1 : 0);
    }
  }

  // The logarithm of the pieces that a line of four control points takes; the same whichever end comes first.
  levelOf(from, step) {
    const { net } = this;
    let bend = 0;
    for (let i = from; i <= from + step; i += step) {
      const x = net[i] + net[i + 2 * step] - 2 * net[i + step];
      const y = net[i + 1] + net[i + 2 * step + 1] - 2 * net[i + step + 1];
      const z = net[i + 2] + net[i + 2 * step + 2] - 2 * net[i + step + 2];
      bend = Math.max(bend, x * x + y * y + z * z);
    }
    let level = 0;
    for (let reach = 1 / this.fineness; level < FINEST && bend > reach * reach; reach *= 4) level++;
    return level;
  }

  // A bicubic Bezier patch as a grid of pieces, as many as its size on the screen asks for. An edge has as many as that edge
  // alone asks for, so that neighbours do not crack: the finer grid inside is drawn together there.
  addPatch(color) {
    const { net, column } = this;
    let level = 0;
    for (let line = 0; line < 4; line++) {
      this.levels[line] = this.levelOf(12 * line, 3);
      this.levels[4 + line] = this.levelOf(3 * line, 12);
      level = Math.max(level, this.levels[line], this.levels[4 + line]);
    }
    const grid = this.grids[level];
    const { pieces, weights, slopes } = grid;
    const shifts = [0, 3, 4, 7].map((line) => level - this.levels[line]);
    let at = this.begin((pieces + 1) ** 2, stitched(grid, shifts));
    const least = 1e-4 * this.squareOfNet();
    for (let j = 0; j <= pieces; j++) {
      // The curve along which x runs, and its rate of change with y.
      for (let k = 0; k < 12; k++) {
        let place = 0, rate = 0;
        for (let row = 0; row < 4; row++) {
          place += weights[4 * j + row] * net[12 * row + k];
          rate += slopes[4 * j + row] * net[12 * row + k];
        }
        column[k] = place;
        column[12 + k] = rate;
      }
      for (let i = 0; i <= pieces; i++, at += CORNER) {
        let x = 0, y = 0, z = 0, ax = 0, ay = 0, az = 0, bx = 0, by = 0, bz = 0;
        for (let k = 0; k < 4; k++) {
          const w = weights[4 * i + k], s = slopes[4 * i + k];
          const cx = column[3 * k], cy = column[3 * k + 1], cz = column[3 * k + 2];
          x += w * cx;
          y += w * cy;
          z += w * cz;
          ax += s * cx;
          ay += s * cy;
          az += s * cz;
          bx += w * column[12 + 3 * k];
          by += w * column[13 + 3 * k];
          bz += w * column[14 + 3 * k];
        }
        let nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
        let length = Math.hypot(nx, ny, nz);
        if (length <= least) {
          // Where an edge shrinks to a point, the normal of a place nearby.
          [nx, ny, nz] = this.normalNear(i / pieces, j / pieces);
          length = Math.hypot(nx, ny, nz) || 1;
        }
        this.put(at, x, y, z, nx / length, ny / length, nz / length, color);
      }
    }
  }

  // Square of the length of a patch.
  squareOfNet() {
    const { net } = this;
    let square = 0;
    for (let k = 0; k < 3; k++) square += (0.5 * (net[9 + k] - net[k] + net[45 + k] - net[36 + k])) ** 2;
    return square;
  }

  normalNear(x, y) {
    const { net } = this;
    const [wx, sx] = bernstein(x + (0.5 - x) * 0.05);
    const [wy, sy] = bernstein(y + (0.5 - y) * 0.05);
    const [a, b] = [[0, 0, 0], [0, 0, 0]];
    for (let i = 0; i < 16; i++) {
      const [row, k] = [i >> 2, i & 3];
      for (let c = 0; c < 3; c++) {
        a[c] += sx[k] * wy[row] * net[3 * i + c];
        b[c] += wx[k] * sy[row] * net[3 * i + c];
      }
    }
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  }

  addPolygon(corners, cut, color) {
    const { net } = this;
    // Newell's normal, relative to the first corner.
    let x = 0, y = 0, z = 0;
    for (let i = 3; i + 3 < 3 * corners; i += 3) {
      const ax = net[i] - net[0], ay = net[i + 1] - net[1], az = net[i + 2] - net[2];
      const bx = net[i + 3] - net[0], by = net[i + 4] - net[1], bz = net[i + 5] - net[2];
      x += ay * bz - az * by;
      y += az * bx - ax * bz;
      z += ax * by - ay * bx;
    }
    const length = Math.hypot(x, y, z) || 1;
    let at = this.begin(corners, cut);
    for (let i = 0; i < 3 * corners; i += 3, at += CORNER) {
      this.put(at, net[i], net[i + 1], net[i + 2], x / length, y / length, z / length, color);
    }
  }
}

// 0xrrggbb as four bytes in the order in which they are drawn.
function bytesOf(rgb) {
  return (0xff000000 | ((rgb & 255) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
}

// Weights of the control points of a cubic at a place, and their rates.
function bernstein(t) {
  const s = 1 - t;
  return [
    [s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t],
    [-3 * s * s, 3 * s * s - 6 * s * t, 6 * s * t - 3 * t * t, 3 * t * t],
  ];
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function direction(v, otherwise) {
  const length = Math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return length > 0 ? [v[0] / length, v[1] / length, v[2] / length] : otherwise;
}

// The outline of a stem (place and normal of each corner, in parts of the radius) with the triangles of its side, of the dome at
// its start and of that at its end.
function tubeForm(outline) {
  const sides = outline.length / 4;
  const steps = Math.max(1, Math.min(8, Math.floor(sides / 8))) + 1;
  const bands = (count, turned) => {
    const triangles = [];
    for (let ring = 1; ring < count; ring++) {
      for (let k = 0; k < sides; k++) {
        const next = (k + 1) % sides;
        const [low, high] = turned ? [ring, ring - 1] : [ring - 1, ring];
        const [a, b, c, d] = [low * sides + k, low * sides + next, high * sides + next, high * sides + k];
        triangles.push(a, b, c, a, c, d);
      }
    }
    return Uint32Array.from(triangles);
  };
  const latitudes = Array.from({ length: steps + 1 }, (_, i) => (Math.PI / 2) * (i / steps));
  return {
    spokes: Float64Array.from(outline),
    latitudes: latitudes.map((angle) => [Math.sin(angle), Math.cos(angle)]),
    side: bands(2, false),
    caps: [bands(steps + 1, true), bands(steps + 1, false)],
  };
}

function gridOf(pieces) {
  const places = Array.from({ length: pieces + 1 }, (_, i) => bernstein(i / pieces));
  const flat = (which) => Float64Array.from(places.flatMap((place) => place[which]));
  return { pieces, weights: flat(0), slopes: flat(1), triangles: new Map() };
}

// Triangles of a grid whose edges (y = 0, y = 1, x = 0, x = 1) have fewer pieces, by powers of two.
function stitched({ pieces, triangles }, [bottom, top, left, right]) {
  const key = ((bottom * 8 + top) * 8 + left) * 8 + right;
  const known = triangles.get(key);
  if (known) return known;
  const corner = (i, j) => {
    const fewer = (at, shift) => (at >> shift) << shift;
    if (j === 0) i = fewer(i, bottom);
    else if (j === pieces) i = fewer(i, top);
    if (i === 0) j = fewer(j, left);
    else if (i === pieces) j = fewer(j, right);
    return j * (pieces + 1) + i;
  };
  const made = [];
  for (let j = 0; j < pieces; j++) {
    for (let i = 0; i < pieces; i++) {
      const [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
      for (const [p, q, r] of [[a, b, c], [a, c, d]]) if (p !== q && q !== r && p !== r) made.push(p, q, r);
    }
  }
  const array = Uint32Array.from(made);
  triangles.set(key, array);
  return array;
}
