// Draws triangles with WebGL 2.

const VERSION = "#version 300 es\nprecision highp float;\n";
const BACKGROUND = [0xfb / 255, 0xfa / 255, 0xf5 / 255];

// Whether what draws is a program and no graphics processor.
function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) throw new Error("this browser does not offer WebGL 2");
  const told = gl.getExtension("WEBGL_debug_renderer_info");
  const name = told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

class Painter {
  constructor(canvas, recording) {
    // Smooth edges take a program as long as all the rest; then what stands still is drawn larger instead.
    this.software = drawsInSoftware();
    const options = { antialias: !this.software, alpha: false, preserveDrawingBuffer: true };
    const gl = (this.gl = canvas.getContext("webgl2", options));
    this.recording = recording;
    this.geometry = new Geometry(recording);
    const { surface, light } = recording.shaders;
    const program = (this.program = this.compiled(surface, light));
    const uniforms = ["view", "projection", "relief", "falloff", "near", "sun", "zenith", "tint"];
    this.places = Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)]));
    gl.useProgram(program);
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    for (const [name, count, type, offset] of [["corner", 3, gl.FLOAT, 0], ["normal", 3, gl.FLOAT, 12], ["color", 4, gl.UNSIGNED_BYTE, 24]]) {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, type, type !== gl.FLOAT, 4 * CORNER, offset);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(...BACKGROUND, 1);
  }

  compiled(vertex, fragment) {
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
    return program;
  }

  // Takes in what is to be seen; see Geometry.
  stage(frame, detail) {
    const { gl, geometry } = this;
    geometry.stage(frame, detail);
    gl.bufferData(gl.ARRAY_BUFFER, geometry.corners.subarray(0, CORNER * geometry.count), gl.STREAM_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, geometry.triangles.subarray(0, geometry.used), gl.STREAM_DRAW);
    this.triangles = geometry.used / 3;
  }

  // The declared light, in the directions of the view; its shadows are in pictures only.
  light(view) {
    const { gl, places } = this;
    const { light } = this.recording;
    if (!light) return gl.uniform3f(places.tint, -1, 0, 0);
    const seen = ([x, y, z]) => [0, 1, 2].map((i) => view[i] * x + view[4 + i] * y + view[8 + i] * z);
    const [zenith, horizon] = (light.sky || ["#b4cdf0", "#f2efe8"]).map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255));
    const mean = zenith.map((c, i) => 0.6 * c + 0.4 * horizon[i]);
    gl.uniform3fv(places.sun, light.sun ? seen(light.sun) : [0, 0, 0]);
    gl.uniform3fv(places.zenith, seen([0, 1, 0]));
    gl.uniform3fv(places.tint, mean.map((c) => c / Math.max(1e-3, ...mean)));
  }

  // Draws what was taken in last.
  paint(camera, width, height) {
    const { gl, places } = this;
    const { view, projection, near } = camera.matrices(width / height);
    const { extent, size } = this.recording;
    const depth = Math.min(...size);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(places.view, false, view);
    gl.uniformMatrix4fv(places.projection, false, projection);
    // Drawings without depth are diagrams: their colours mean something.
    gl.uniform1f(places.relief, Math.min(1, depth / 0.02));
    gl.uniform1f(places.falloff, (0.16 * Math.min(1, depth / 0.2)) / extent);
    gl.uniform1f(places.near, near);
    this.light(view);
    gl.drawElements(gl.TRIANGLES, 3 * this.triangles, gl.UNSIGNED_INT, 0);
  }
}
