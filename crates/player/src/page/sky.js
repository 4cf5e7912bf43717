// The declared sky behind everything.

class Sky {
  constructor(gl, { light, shaders }, compiled) {
    this.gl = gl;
    const program = (this.program = compiled(shaders.sky, shaders.heaven));
    this.places = Object.fromEntries(["zenith", "slope"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.array = gl.createVertexArray();
    gl.useProgram(program);
    ["high", "low"].forEach((name, i) => gl.uniform3fv(gl.getUniformLocation(program, name), channelsOf(light.sky[i])));
  }

  // `slope`: half of the height that is seen at the distance 1; 0 without perspective.
  paint(view, slope) {
    const { gl, places } = this;
    gl.useProgram(this.program);
    gl.uniform3f(places.zenith, view[4], view[5], view[6]);
    gl.uniform1f(places.slope, slope);
    gl.bindVertexArray(this.array);
    gl.depthMask(false);
    gl.disable(gl.DEPTH_TEST);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.bindVertexArray(null);
  }
}

// "#rrggbb" as parts of 1.
function channelsOf(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
}
