// Shadows: maps of what is nearest to the sun, and to each of many places of the sky, as in pictures (crates/render/src/shadow.rs), in
// fewer and coarser ones. The maps are of a ball around the plant over the whole recording, so that shadows stand still where the plant does.

// Places of the sky, and cells along the sides of the maps.
const PLACES = 32;
const SKY_CELLS = 128;
const SUN_CELLS = 2048;
// While something moves, so many of the sky's maps are made anew for a picture. A program that stands in for a graphics processor makes
// none then, nor looks them up.
const AT_ONCE = 4;

class Shadows {
  // `points`: those of the plant that are outermost in some direction; `beyond`: how far from the origin something else may be.
  constructor(gl, { shaders, light }, points, beyond, compiled, option, software) {
    this.gl = gl;
    const bounds = [0, 1, 2].map((k) => points.reduce(([low, high], p) => [Math.min(low, p[k]), Math.max(high, p[k])], [Infinity, -Infinity]));
    this.middle = bounds.map(([low, high]) => (low + high) / 2);
    this.bottom = bounds[1][0];
    this.top = bounds[1][1];
    this.half = Math.max(...[0, 2].map((k) => (bounds[k][1] - bounds[k][0]) / 2));
    const apart = (p) => Math.hypot(...p.map((x, k) => x - this.middle[k]));
    this.reach = 1.02 * points.reduce((most, p) => Math.max(most, apart(p)), 0);
    this.depths = this.reach + beyond + Math.hypot(...this.middle);
    this.software = software;
    this.programs = [];
    this.sun = light?.sun ?? null;
    this.sky = Array.from({ length: PLACES }, (_, i) => placeOfSky(i));
    this.program = compiled(option + shaders.shade + shaders.shadow, option + shaders.cast);
    this.from = gl.getUniformLocation(this.program, "light");
    gl.useProgram(this.program);
    this.setBall(this.program);
    this.sunMap = this.made(1, software ? SUN_CELLS / 2 : SUN_CELLS, gl.TEXTURE_2D, 1);
    this.skyMaps = this.made(2, SKY_CELLS, gl.TEXTURE_2D_ARRAY, PLACES);
    this.buffer = gl.createFramebuffer();
    this.next = 0;
    this.stale = 0;
  }

  // A texture of depths on a unit of its own, which is compared when it is read.
  made(unit, cells, kind, layers) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, texture);
    if (layers > 1) gl.texStorage3D(kind, 1, gl.DEPTH_COMPONENT24, cells, cells, layers);
    else gl.texStorage2D(kind, 1, gl.DEPTH_COMPONENT24, cells, cells);
    gl.texParameteri(kind, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, filter, gl.LINEAR);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, wrap, gl.CLAMP_TO_EDGE);
    gl.activeTexture(gl.TEXTURE0);
    return { texture, cells };
  }

  setBall(program) {
    const { gl } = this;
    const place = (name) => gl.getUniformLocation(program, name);
    gl.uniform3fv(place("middle"), this.middle);
    gl.uniform1f(place("reach"), this.reach);
    gl.uniform1f(place("depths"), this.depths);
  }

  // Tells a program where the maps are, and what of.
  bind(program) {
    const { gl } = this;
    const place = (name) => gl.getUniformLocation(program, name);
    gl.useProgram(program);
    this.setBall(program);
    gl.uniform1i(place("sun_map"), 1);
    gl.uniform1i(place("sky_maps"), 2);
    gl.uniform3fv(place("sun_from"), this.sun ?? [0, 0, 0]);
    gl.uniform3fv(place("sky_from"), this.sky.flat());
    this.programs.push([program, place("has_sky")]);
  }

  // What casts shadows has changed.
  change() {
    this.stale = PLACES;
    this.sunIsStale = Boolean(this.sun);
  }

  // Makes maps of what `draw` draws, if there is something new: the sun's, and all of the sky's or some.
  make(all, draw) {
    const { gl } = this;
    const hasSky = all || !this.software;
    for (const [program, place] of this.programs) {
      gl.useProgram(program);
      gl.uniform1i(place, hasSky);
    }
    if (!(this.stale && hasSky) && !this.sunIsStale) return;
    gl.useProgram(this.program);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.drawBuffers([gl.NONE]);
    const map = (cells, light) => {
      gl.viewport(0, 0, cells, cells);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      gl.uniform3fv(this.from, light);
      draw();
    };
    if (this.sunIsStale) {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.sunMap.texture, 0);
      map(this.sunMap.cells, this.sun);
      this.sunIsStale = false;
    }
    for (let count = Math.min(this.stale, all ? PLACES : hasSky ? AT_ONCE : 0); count > 0; count--) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, this.skyMaps.texture, 0, this.next);
      map(this.skyMaps.cells, this.sky[this.next]);
      this.next = (this.next + 1) % PLACES;
      this.stale--;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}

// The direction towards a place of the sky: evenly spread, along a spiral at golden angles (Vogel 1979).
function placeOfSky(i) {
  const up = (i + 0.5) / PLACES, flat = Math.sqrt(1 - up * up);
  return [flat * Math.sin(2.399963229728653 * i), up, flat * Math.cos(2.399963229728653 * i)];
}
