// Draws stages with WebGL 2: one call for everything of one form.

const VERSION = "#version 300 es\nprecision highp float;\n";
const BACKGROUND = [0xfb / 255, 0xfa / 255, 0xf5 / 255];
const PATCH_ROWS = [0, 1, 2, 3].flatMap((row) => ["a", "b", "c"].map((part) => `row${row}${part}`));

// Attributes that change from thing to thing, each with the count of its numbers; after them its colour in four bytes.
const PLACED = [
  ["centre0", "u0", "v0", "centre1", "u1", "v1"].map((name) => [name, 3]),
  ["origin", "first", "second"].map((name) => [name, 3]),
  PATCH_ROWS.map((name) => [name, 4]),
];
const SHADER = ["stem", "mesh", "patch"];

class Painter {
  constructor(canvas, recording) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser does not offer WebGL 2");
    this.gl = gl;
    this.recording = recording;
    this.palette = recording.palette.map((hex) => parseInt(hex.slice(1), 16));
    this.programs = Object.fromEntries(
      [...SHADER, "polygon"].map((name) => [name, this.program(recording.shaders[name], recording.shaders.light)]),
    );
    // By kind, the forms that things can have.
    this.groups = [[], [], []];
    recording.outlines.forEach((outline, i) => (this.groups[0][i] = this.stemForms(outline)));
    recording.meshes.forEach((mesh, i) => (this.groups[1][i] = [this.meshForm(mesh)]));
    this.groups[2][0] = [this.patchForm(recording.patchPieces)];
    this.polygons = this.polygonForm();
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(...BACKGROUND, 1);
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, VERSION + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = ["view", "projection", "relief", "falloff", "near"];
    const places = Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)]));
    return { program, places };
  }

  // A form that is drawn many times: its own attributes (name, count of numbers, array), triangles, and its kind.
  form(kind, attributes, triangles) {
    const { gl } = this;
    const { program } = this.programs[SHADER[kind]];
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [name, count, numbers] of attributes) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
      const bytes = numbers instanceof Uint8Array;
      this.attribute(program, name, count, bytes ? gl.UNSIGNED_BYTE : gl.FLOAT, 0, 0, 0);
    }
    const placed = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, placed);
    const stride = 4 * (WIDTHS[kind] + 1);
    let offset = 0;
    for (const [name, count] of PLACED[kind]) {
      this.attribute(program, name, count, gl.FLOAT, stride, offset, 1);
      offset += 4 * count;
    }
    this.attribute(program, "color", 4, gl.UNSIGNED_BYTE, stride, offset, 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { kind, array, placed, indices: triangles.length, ...this.room(WIDTHS[kind] + 1) };
  }

  attribute(program, name, count, type, stride, offset, divisor) {
    const { gl } = this;
    const place = gl.getAttribLocation(program, name);
    // The compiler takes out what is not used.
    if (place < 0) return;
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, count, type, type === gl.UNSIGNED_BYTE, stride, offset);
    gl.vertexAttribDivisor(place, divisor);
  }

  // Space for things of so many numbers, which grows.
  room(width) {
    const numbers = new Float32Array(width * 64);
    return { width, count: 0, numbers, colors: new Uint32Array(numbers.buffer) };
  }

  grow(room, count) {
    if ((room.count + count) * room.width <= room.numbers.length) return;
    const numbers = new Float32Array(2 * (room.count + count) * room.width);
    numbers.set(room.numbers);
    room.numbers = numbers;
    room.colors = new Uint32Array(numbers.buffer);
  }

  // The side of a stem, the cap of its start and that of its end.
  stemForms(outline) {
    const sides = outline.length / 4;
    const steps = Math.max(1, Math.min(8, Math.floor(sides / 8))) + 1;
    const rings = (list) => {
      const spokes = [], parts = [], triangles = [];
      for (const part of list) {
        for (let k = 0; k < sides; k++) {
          spokes.push(...outline.slice(4 * k, 4 * k + 4));
          parts.push(...part);
        }
      }
      for (let ring = 1; ring < list.length; ring++) {
        for (let k = 0; k < sides; k++) {
          const next = (k + 1) % sides;
          const [a, b, c, d] = [[ring - 1, k], [ring - 1, next], [ring, next], [ring, k]].map(([r, s]) => r * sides + s);
          triangles.push(a, b, c, a, c, d);
        }
      }
      return this.form(0, [["spoke", 4, new Float32Array(spokes)], ["part", 4, new Float32Array(parts)]], triangles);
    };
    const latitudes = Array.from({ length: steps + 1 }, (_, i) => (Math.PI / 2) * (i / steps));
    const cap = (end, side) => latitudes.map((angle) => [end, Math.sin(angle), Math.cos(angle), side]);
    return [rings([[0, 0, 1, 0], [1, 0, 1, 0]]), rings(cap(0, -1).reverse()), rings(cap(1, 1))];
  }

  meshForm({ places, normals, colors, triangles }) {
    const bytes = new Uint8Array(4 * colors.length);
    colors.forEach((color, i) => {
      const rgb = color < 0 ? -color - 1 : color;
      bytes.set([rgb >> 16, (rgb >> 8) & 255, rgb & 255, color < 0 ? 255 : 0], 4 * i);
    });
    const attributes = [["corner", 3, new Float32Array(places)], ["normal", 3, new Float32Array(normals)], ["own", 4, bytes]];
    return this.form(1, attributes, triangles.flat());
  }

  patchForm(pieces) {
    const places = [], triangles = [];
    const row = pieces + 1;
    for (let j = 0; j < row; j++) {
      for (let i = 0; i < row; i++) {
        places.push(i / pieces, j / pieces);
        const a = j * row + i;
        if (i < pieces && j < pieces) triangles.push(a, a + 1, a + row + 1, a, a + row + 1, a + row);
      }
    }
    return this.form(2, [["place", 2, new Float32Array(places)]], triangles);
  }

  polygonForm() {
    const { gl } = this;
    const { program } = this.programs.polygon;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const placed = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, placed);
    this.attribute(program, "corner", 3, gl.FLOAT, 28, 0, 0);
    this.attribute(program, "normal", 3, gl.FLOAT, 28, 12, 0);
    this.attribute(program, "color", 4, gl.UNSIGNED_BYTE, 28, 24, 0);
    const indices = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    gl.bindVertexArray(null);
    return { array, placed, indices, triangles: new Uint32Array(1024), used: 0, ...this.room(7) };
  }

  // The four bytes of a material's colour; all 0 for none.
  bytes(material) {
    if (material < 0) return 0;
    const rgb = this.palette[material];
    return (0xff000000 | ((rgb & 255) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
  }

  // Takes in what is to be seen at a place between frames.
  stage(frame) {
    const now = Math.floor(frame);
    for (const form of this.groups.flat(2)) form.count = 0;
    this.polygons.count = this.polygons.used = 0;
    for (const track of this.recording.tracks) {
      if (track.first > now) break;
      if (track.last < now) continue;
      const look = lookAt(track, now);
      if (track.kind === 3) {
        this.addPolygon(track, frame, look);
        continue;
      }
      const forms = this.groups[track.kind][track.detail];
      const [side] = forms;
      this.grow(side, 1);
      const at = side.count++ * side.width;
      placeAt(track, frame, side.numbers, at);
      side.colors[at + side.width - 1] = this.bytes(look.material);
      for (let end = 0; end < 2 && track.kind === 0; end++) {
        if (look.variant & (1 << end)) {
          const cap = forms[1 + end];
          this.grow(cap, 1);
          cap.numbers.set(side.numbers.subarray(at, at + side.width), cap.count++ * cap.width);
        }
      }
    }
  }

  addPolygon(track, frame, look) {
    const { polygons } = this;
    const corners = track.detail;
    const cut = this.recording.cuts[look.variant];
    this.corners ??= new Float32Array(3);
    if (this.corners.length < 3 * corners) this.corners = new Float32Array(3 * corners);
    const from = this.corners;
    placeAt(track, frame, from, 0);
    // Newell's normal, relative to the first corner.
    let x = 0, y = 0, z = 0;
    for (let i = 1; i + 1 < corners; i++) {
      const [ax, ay, az] = [from[3 * i] - from[0], from[3 * i + 1] - from[1], from[3 * i + 2] - from[2]];
      const [bx, by, bz] = [from[3 * i + 3] - from[0], from[3 * i + 4] - from[1], from[3 * i + 5] - from[2]];
      x += ay * bz - az * by;
      y += az * bx - ax * bz;
      z += ax * by - ay * bx;
    }
    const length = Math.hypot(x, y, z) || 1;
    this.grow(polygons, corners);
    const { count, numbers, colors } = polygons;
    const color = this.bytes(look.material);
    for (let i = 0, at = 7 * count; i < corners; i++, at += 7) {
      for (let k = 0; k < 3; k++) numbers[at + k] = from[3 * i + k];
      numbers[at + 3] = x / length;
      numbers[at + 4] = y / length;
      numbers[at + 5] = z / length;
      colors[at + 6] = color;
    }
    if (polygons.used + 3 * cut.length > polygons.triangles.length) {
      const more = new Uint32Array(2 * (polygons.used + 3 * cut.length));
      more.set(polygons.triangles);
      polygons.triangles = more;
    }
    for (const triangle of cut) {
      for (let k = 0; k < 3; k++) polygons.triangles[polygons.used++] = count + triangle[k];
    }
    polygons.count += corners;
  }

  // Draws what was taken in last.
  paint(camera, width, height) {
    const { gl } = this;
    const { view, projection, near } = camera.matrices(width / height);
    const { extent, size } = this.recording;
    const depth = Math.min(...size);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const begin = ({ program, places }) => {
      gl.useProgram(program);
      gl.uniformMatrix4fv(places.view, false, view);
      gl.uniformMatrix4fv(places.projection, false, projection);
      // Drawings without depth are diagrams: their colours mean something.
      gl.uniform1f(places.relief, Math.min(1, depth / 0.02));
      gl.uniform1f(places.falloff, (0.16 * Math.min(1, depth / 0.2)) / extent);
      gl.uniform1f(places.near, near);
    };
    let triangles = 0;
    this.groups.forEach((forms, kind) => {
      begin(this.programs[SHADER[kind]]);
      for (const form of forms.flat()) {
        if (!form.count) continue;
        gl.bindVertexArray(form.array);
        gl.bindBuffer(gl.ARRAY_BUFFER, form.placed);
        gl.bufferData(gl.ARRAY_BUFFER, form.numbers.subarray(0, form.count * form.width), gl.STREAM_DRAW);
        gl.drawElementsInstanced(gl.TRIANGLES, form.indices, gl.UNSIGNED_INT, 0, form.count);
        triangles += (form.indices / 3) * form.count;
      }
    });
    const { polygons } = this;
    if (polygons.used) {
      begin(this.programs.polygon);
      gl.bindVertexArray(polygons.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, polygons.placed);
      gl.bufferData(gl.ARRAY_BUFFER, polygons.numbers.subarray(0, polygons.count * 7), gl.STREAM_DRAW);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, polygons.indices);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, polygons.triangles.subarray(0, polygons.used), gl.STREAM_DRAW);
      gl.drawElements(gl.TRIANGLES, polygons.used, gl.UNSIGNED_INT, 0);
      triangles += polygons.used / 3;
    }
    gl.bindVertexArray(null);
    this.triangles = triangles;
  }
}
