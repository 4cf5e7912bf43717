// Gases: the blobs of each frame out of their bytes (clouds.rs says how they are written), and how they are drawn.

// Numbers of a blob: centre, standard deviation, optical depth, light.
const PUFF = 8;
// The same, and how much of it is shown.
const SHOWN = 9;

class Clouds {
  constructor(bytes, frames, unit) {
    const { natural, integer } = reader(bytes);
    this.frames = [];
    let before = { codes: new Int32Array(0) };
    while (this.frames.length < frames) {
      const runs = Array.from({ length: natural() }, natural);
      const fresh = natural();
      const kept = [];
      runs.reduce((at, run, i) => {
        if (i % 2 === 0) for (let k = at; k < at + run; k++) kept.push(k);
        return at + run;
      }, 0);
      const count = kept.length + fresh;
      const codes = new Int32Array(PUFF * count);
      for (let number = 0; number < PUFF; number++) {
        kept.forEach((from, to) => (codes[PUFF * to + number] = before.codes[PUFF * from + number] + integer()));
        for (let to = kept.length, near = 0; to < count; to++) codes[PUFF * to + number] = near += integer();
      }
      // Where a blob of the frame before is in this one.
      if (before.next) kept.forEach((from, to) => (before.next[from] = to));
      const frame = { count, kept: kept.length, codes, puffs: new Float32Array(PUFF * count), next: new Int32Array(count).fill(-1) };
      for (let at = 0; at < codes.length; at += PUFF) {
        for (let k = 0; k < 4; k++) frame.puffs[at + k] = codes[at + k] * unit;
        frame.puffs[at + 4] = 2 ** ((codes[at + 4] - 256) / 16);
        for (let k = 5; k < PUFF; k++) frame.puffs[at + k] = codes[at + k] / 255;
      }
      this.frames.push(frame);
      before.codes = null;
      before = frame;
    }
    before.codes = null;
  }

  // Writes the blobs at a place between frames; returns their number. One that begins or ends between them comes or goes slowly.
  at(place, out) {
    const now = Math.min(Math.floor(place), this.frames.length - 1);
    const part = place - now;
    const [{ puffs, next, count }, after] = [this.frames[now], this.frames[now + 1]];
    let to = 0;
    const put = (from, at, share) => {
      for (let k = 0; k < PUFF; k++) out[to + k] = from[at + k];
      out[to + PUFF] = share;
      to += SHOWN;
    };
    for (let i = 0; i < count; i++) {
      put(puffs, PUFF * i, next[i] < 0 && after ? 1 - part : 1);
      if (next[i] < 0 || part === 0) continue;
      for (let k = 0; k < PUFF; k++) out[to - SHOWN + k] += part * (after.puffs[PUFF * next[i] + k] - out[to - SHOWN + k]);
    }
    if (after && part > 0) for (let i = after.kept; i < after.count; i++) put(after.puffs, PUFF * i, part);
    return to / SHOWN;
  }

  // Most blobs that are shown at once.
  get most() {
    return this.frames.reduce((most, { count }, i) => Math.max(most, count + (this.frames[i + 1]?.count ?? 0)), 0);
  }

  // About so many balls around blobs that are seen well.
  outermost(count) {
    const skip = Math.ceil(this.frames.reduce((sum, frame) => sum + frame.count, 0) / count);
    const balls = [];
    let turn = 0;
    for (const { puffs } of this.frames) {
      for (let at = 0; at < puffs.length; at += PUFF) {
        if (turn++ % skip === 0 && puffs[at + 4] > 0.02) balls.push([puffs[at], puffs[at + 1], puffs[at + 2], 1.5 * puffs[at + 3]]);
      }
    }
    return balls;
  }
}

// Draws blobs over what is drawn, the farthest first.
class Veil {
  constructor(gl, { clouds, shaders }, compiled) {
    this.gl = gl;
    this.clouds = clouds;
    const program = (this.program = compiled(shaders.puff, shaders.veil));
    this.places = Object.fromEntries(["view", "projection"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    for (const [name, count, offset] of [["centre", 3, 0], ["deviation", 1, 3], ["light", 3, 4], ["depth", 2, 7]]) {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 4 * SHOWN, 4 * offset);
      gl.vertexAttribDivisor(place, 1);
    }
    gl.bindVertexArray(null);
    const { most } = clouds;
    this.puffs = new Float32Array(SHOWN * most);
    this.sorted = new Float32Array(SHOWN * most);
    this.depths = new Float32Array(most);
    this.count = 0;
  }

  stage(frame) {
    this.count = this.clouds.at(frame, this.puffs);
  }

  paint(view, projection) {
    const { gl, count, puffs, sorted, depths } = this;
    if (!count) return;
    for (let i = 0, at = 0; i < count; i++, at += SHOWN) {
      depths[i] = view[2] * puffs[at] + view[6] * puffs[at + 1] + view[10] * puffs[at + 2];
    }
    const order = Uint32Array.from({ length: count }, (_, i) => i).sort((a, b) => depths[a] - depths[b]);
    order.forEach((i, to) => {
      const [from, at] = [SHOWN * i, SHOWN * to];
      for (let k = 0; k < 4; k++) sorted[at + k] = puffs[from + k];
      for (let k = 0; k < 3; k++) sorted[at + 4 + k] = puffs[from + 5 + k];
      sorted[at + 7] = puffs[from + 4];
      sorted[at + 8] = puffs[from + 8];
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, sorted.subarray(0, SHOWN * count), gl.STREAM_DRAW);
    gl.bindVertexArray(this.array);
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(this.places.view, false, view);
    gl.uniformMatrix4fv(this.places.projection, false, projection);
    const covers = gl.isEnabled(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.disable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    if (covers) gl.enable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.bindVertexArray(null);
  }
}
