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

// Corners, normals and colours have the same places in all programs, so that one array of them serves all.
const ATTRIBUTES = ["corner", "normal", "color", "pin"];

class Painter {
  // `points`: those of the plant that are outermost in some direction; `beyond`: how far from the origin ground of soil may be.
  constructor(canvas, recording, points, beyond) {
    // Smooth edges take a program as long as all the rest; then what stands still is drawn larger instead.
    this.software = drawsInSoftware();
    const options = { antialias: !this.software, alpha: false, preserveDrawingBuffer: true };
    const gl = (this.gl = canvas.getContext("webgl2", options));
    this.recording = recording;
    this.geometry = new Geometry(recording);
    // Those of scenes are there if there is one.
    const { shade, open = "", sun = "", surface, light } = recording.shaders;
    const { hasPictures } = this.geometry;
    // Drawings without depth are diagrams: their colours mean something, and nothing casts a shadow.
    this.relief = Math.min(1, Math.min(...recording.size) / 0.02);
    const hasFloor = recording.floor !== null && this.relief > 0;
    const casts = (recording.light || hasFloor) && this.relief > 0 && points.length > 0;
    const option = hasPictures ? "#define PICTURES\nprecision highp sampler2DArray;\n" : "";
    const receiving = casts ? `#define RECEIVES\n#define PLACES ${PLACES}\n` : "";
    const before = option + receiving + shade;
    const program = (this.program = this.compiled(before + open + surface, before + sun + light));
    const uniforms = ["view", "projection", "relief", "falloff", "near", "sun", "zenith", "tint"];
    this.places = Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(program, name)]));
    const compiled = (vertex, fragment) => this.compiled(vertex, fragment);
    this.shadows = casts ? new Shadows(gl, recording, points, beyond, compiled, option, this.software) : null;
    this.shadows?.bind(program);
    this.floor = hasFloor ? new Floor(gl, recording, this.shadows, compiled, receiving) : null;
    gl.useProgram(program);
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    for (const [name, count, type, offset] of [["corner", 3, gl.FLOAT, 0], ["normal", 3, gl.FLOAT, 12], ["color", 4, gl.UNSIGNED_BYTE, 24]]) {
      const place = ATTRIBUTES.indexOf(name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, type, type !== gl.FLOAT, 4 * CORNER, offset);
    }
    if (hasPictures) {
      this.pins = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.pins);
      const place = ATTRIBUTES.indexOf("pin");
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, PIN, gl.FLOAT, false, 4 * PIN, 0);
      // What is cut out has edges as smooth as those of triangles.
      if (!this.software) gl.enable(gl.SAMPLE_ALPHA_TO_COVERAGE);
      gl.uniform1f(gl.getUniformLocation(program, "smooth_edges"), this.software ? 0 : 1);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.enable(gl.DEPTH_TEST);
    this.veil = recording.clouds ? new Veil(gl, recording, compiled) : null;
    this.sky = recording.light?.sky ? new Sky(gl, recording, compiled) : null;
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
    ATTRIBUTES.forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  // Unpacks the pictures into the layers of one texture, all of one size: that of the largest, as far as that goes.
  async unpack() {
    const { gl } = this;
    const { pictures } = this.recording;
    if (!pictures.length) {
      this.isReady = true;
      return;
    }
    const power = (side) => 2 ** Math.ceil(Math.log2(Math.max(1, side)));
    const most = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE), pictures.length > 8 ? 1024 : 2048);
    const [width, height] = [0, 1].map((k) => Math.min(most, Math.max(...pictures.map(({ size }) => power(size[k])))));
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
    const levels = 1 + Math.log2(Math.max(width, height));
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, levels, gl.RGBA8, width, height, pictures.length);
    // Colours times opacity, so that nothing of the colour of what is cut out gets into the mean.
    const options = { resizeWidth: width, resizeHeight: height, resizeQuality: "high", premultiplyAlpha: "premultiply" };
    for (const [layer, { file }] of pictures.entries()) {
      const bytes = Uint8Array.from(atob(file), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), options);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, width, height, 1, gl.RGBA, gl.UNSIGNED_BYTE, image);
      image.close();
    }
    gl.generateMipmap(gl.TEXTURE_2D_ARRAY);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D_ARRAY, wrap, gl.CLAMP_TO_EDGE);
    const sharp = gl.getExtension("EXT_texture_filter_anisotropic");
    if (sharp) gl.texParameterf(gl.TEXTURE_2D_ARRAY, sharp.TEXTURE_MAX_ANISOTROPY_EXT, 8);
    this.isReady = true;
  }

  // Takes in what is to be seen; see Geometry.
  stage(frame, detail) {
    const { gl, geometry } = this;
    geometry.stage(frame, detail);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, geometry.corners.subarray(0, CORNER * geometry.count), gl.STREAM_DRAW);
    if (this.pins) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.pins);
      gl.bufferData(gl.ARRAY_BUFFER, geometry.pins.subarray(0, PIN * geometry.count), gl.STREAM_DRAW);
    }
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, geometry.triangles.subarray(0, geometry.used), gl.STREAM_DRAW);
    this.triangles = geometry.used / 3;
    this.shadows?.change();
    this.veil?.stage(frame);
  }

  // The declared light, in the directions of the view.
  light(view) {
    const { gl, places } = this;
    const { light } = this.recording;
    gl.uniform3fv(places.tint, tintOf(light));
    if (!light) return;
    const seen = ([x, y, z]) => [0, 1, 2].map((i) => view[i] * x + view[4 + i] * y + view[8 + i] * z);
    gl.uniform3fv(places.sun, light.sun ? seen(light.sun) : [0, 0, 0]);
    gl.uniform3fv(places.zenith, seen([0, 1, 0]));
  }

  // Draws what was taken in last, once pictures are unpacked. `sharp`: as well as can be, for what stands still.
  paint(camera, width, height, sharp) {
    if (!this.isReady) return;
    const { gl, places, relief } = this;
    const draw = () => gl.drawElements(gl.TRIANGLES, 3 * this.triangles, gl.UNSIGNED_INT, 0);
    this.shadows?.make(sharp, draw);
    const { view, projection, near } = camera.matrices(width / height);
    const { extent, size } = this.recording;
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.sky?.paint(view, camera.perspective ? camera.slope(width / height) : 0);
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(places.view, false, view);
    gl.uniformMatrix4fv(places.projection, false, projection);
    gl.uniform1f(places.relief, relief);
    gl.uniform1f(places.falloff, (0.16 * Math.min(1, Math.min(...size) / 0.2)) / extent);
    gl.uniform1f(places.near, near);
    this.light(view);
    draw();
    this.floor?.paint(view, projection, relief);
    this.veil?.paint(view, projection);
  }
}

// The tint of what only a declared sky lights, or of the sky that is there beside a declared sun; the first number is negative without either.
function tintOf(light) {
  if (!light) return [-1, 0, 0];
  const [zenith, horizon] = (light.sky || ["#b4cdf0", "#f2efe8"]).map(channelsOf);
  const mean = zenith.map((c, i) => 0.6 * c + 0.4 * horizon[i]);
  return mean.map((c) => c / Math.max(1e-3, ...mean));
}
