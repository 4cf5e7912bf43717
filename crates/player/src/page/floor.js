// The rigid floor under the plant: a grid, fine where the plant darkens the sky for it, and from there as far as it is seen.

// Squares along a side of the fine grid, and how far the floor is seen, in parts of the extent.
const SQUARES = 96;
const FAR_AWAY = 300;
// How far the fine grid reaches beyond the plant, in parts of its height above the floor.
const BEYOND = 1.5;
// The colour of bare ground, and its part beside the haze of the horizon under a declared sky.
const EARTH = "#a99a78";
const EARTHY = 0.6;

class Floor {
  constructor(gl, { light, floor, floorColor, extent, shaders }, shadows, compiled, option) {
    this.gl = gl;
    const before = option + shaders.shade;
    const program = (this.program = compiled(before + shaders.open + shaders.lawn, before + shaders.sun + shaders.floor));
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    const high = shadows ? Math.max(0, shadows.top - floor) : extent;
    const around = ((shadows?.half ?? 0) + BEYOND * high) || extent;
    const rim = (FAR_AWAY * extent) / around;
    const lines = [-rim, ...Array.from({ length: SQUARES + 1 }, (_, i) => (2 * i) / SQUARES - 1), rim];
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(lines.flatMap((z) => lines.flatMap((x) => [x, z]))), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    // Seen from above against the clock.
    const count = lines.length, squares = [];
    for (let at = 0; at + count + 1 < count * count; at++) {
      if ((at + 1) % count) squares.push(at, at + count, at + count + 1, at, at + count + 1, at + 1);
    }
    this.count = squares.length;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint16Array.from(squares), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.places = Object.fromEntries(["view", "projection", "relief"].map((name) => [name, gl.getUniformLocation(program, name)]));
    gl.useProgram(program);
    shadows?.bind(program);
    const set = (name) => gl.getUniformLocation(program, name);
    gl.uniform1f(set("height"), floor);
    gl.uniform1f(set("around"), around);
    gl.uniform1f(set("extent"), extent);
    const earth = floorColor ? channelsOf(floorColor) : light?.sky ? channelsOf(EARTH).map((c, k) => EARTHY * c + (1 - EARTHY) * channelsOf(light.sky[1])[k]) : [-1, 0, 0];
    gl.uniform3fv(set("earth"), earth);
    gl.uniform3fv(set("tint"), tintOf(light));
  }

  // Over what is drawn, where nothing is in front of it.
  paint(view, projection, relief) {
    const { gl, places } = this;
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(places.view, false, view);
    gl.uniformMatrix4fv(places.projection, false, projection);
    gl.uniform1f(places.relief, relief);
    gl.bindVertexArray(this.array);
    const covers = gl.isEnabled(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.disable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    // From below the plant is seen through it.
    gl.enable(gl.CULL_FACE);
    gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_SHORT, 0);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    if (covers) gl.enable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.bindVertexArray(null);
  }
}
