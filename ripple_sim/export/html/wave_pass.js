// The waves of a surface by one fragment pass a substep, over a texture of heights and velocities
// (shaders/wave_step.frag).

const LOAD_VERTEX = shaderOf("wave_load.vert");
const LOAD_FRAGMENT = shaderOf("wave_load.frag");

// Why WebGL cannot solve the waves of a surface, or "".
function passFault(gl, law) {
  if (!gl.getExtension("EXT_color_buffer_float")) return "no textures of floats to draw into";
  if (law.meta.balanced.some(kept => kept)) return "a sum over all texels in every substep";
  const {width, height, most} = layoutOf(law);
  return Math.max(width, height * most) > gl.getParameter(gl.MAX_TEXTURE_SIZE) ? "too many texels" : "";
}

// Width and height of a texture with a place for every texel and the fixed rim, so that all links
// fit about into a square, and the greatest number of links of a texel.
function layoutOf({count, begins}) {
  let most = 1;
  for (let i = 0; i < count; i++) most = Math.max(most, begins[i + 1] - begins[i]);
  const width = 2 ** Math.ceil(Math.log2(Math.sqrt((count + 1) * most)));
  return {width, height: Math.ceil((count + 1) / width), most};
}

class WavePass {
  get kind() {
    return "pass";
  }

  constructor(law, gl) {
    const {width, height, most} = layoutOf(law);
    Object.assign(this, {law, gl, width, height, most});
    this.h = new Float32Array(law.count + 1);
    this.v = new Float32Array(law.count + 1);
    this.pixels = new Float32Array(4 * width * height);
    this.acceleration = new Float32Array(law.parts);
    this.states = [0, 1].map(() => tableOf(gl, "RG32F", width, height));
    this.load = tableOf(gl, "R32F", width, height);
    this.coefficients = tableOf(gl, "RGBA32F", width, height);
    this.links = tableOf(gl, "RGBA32F", width, height * most);
    this.accelerations = tableOf(gl, "R32F", law.parts, 1);
    this.targets = [...this.states, this.load].map(texture =>
      framebufferOf(gl, {COLOR_ATTACHMENT0: texture}),
    );
    this.program = programOf(gl, EVERYWHERE_VERTEX, shaderOf("wave_step.frag"), [`WIDTH ${width}`]);
    this.loading = programOf(gl, LOAD_VERTEX, LOAD_FRAGMENT);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.loads = vertexBuffer(gl, 0, 2, new Float32Array(2), true);
    this.none = gl.createVertexArray();
    this.upload(this.links, 4, this.linkTable());
    this.hold({texels: [], forces: [], acceleration: this.acceleration});
    this.touch();
  }

  // Links that a texel does not have lead to itself, with weight 0.
  linkTable() {
    const {
      law: {count, begins, others, elastic, viscous, part},
      width,
      height,
      most,
    } = this;
    const table = new Float32Array(4 * width * height * most);
    for (let k = 0; k < most; k++)
      for (let i = 0; i < width * height; i++) {
        const link = i < count ? begins[i] + k : 0;
        const has = i < count && link < begins[i + 1];
        table.set(
          [has ? others[link] : i, has ? elastic[link] : 0, has && viscous ? viscous[link] : 0, part[i] || 0],
          4 * (k * width * height + i),
        );
      }
    return table;
  }

  upload(texture, channels, data) {
    const gl = this.gl;
    const width = Math.min(this.width, data.length / channels);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(
      gl.TEXTURE_2D,
      0,
      0,
      0,
      width,
      data.length / channels / width,
      [0, gl.RED, gl.RG, 0, gl.RGBA][channels],
      gl.FLOAT,
      data,
    );
  }

  // Heights and velocities as they are now.
  read() {
    if (this.current) return this;
    const {gl, pixels, h, v} = this;
    const {count} = this.law;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[0]);
    gl.readPixels(0, 0, this.width, this.height, gl.RGBA, gl.FLOAT, pixels);
    for (let i = 0; i < count; i++) {
      h[i] = pixels[4 * i];
      v[i] = pixels[4 * i + 1];
    }
    this.current = true;
    return this;
  }

  // Takes over heights and velocities that were changed here.
  touch() {
    const {
      h,
      v,
      law: {count},
    } = this;
    const data = new Float32Array(2 * this.width * this.height);
    for (let i = 0; i < count; i++) {
      data[2 * i] = h[i];
      data[2 * i + 1] = v[i];
    }
    this.upload(this.states[0], 2, data);
    this.current = true;
  }

  hold({texels, forces, acceleration}) {
    const gl = this.gl;
    const data = new Float32Array(2 * texels.length);
    for (let k = 0; k < texels.length; k++) {
      data[2 * k] = texels[k];
      data[2 * k + 1] = forces[k];
    }
    this.acceleration = Float32Array.from(acceleration);
    this.upload(this.accelerations, 1, this.acceleration);
    this.begin(this.targets[2]);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (!texels.length) return;
    gl.useProgram(this.loading.program);
    gl.uniform2i(gl.getUniformLocation(this.loading.program, "size"), this.width, this.height);
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.loads);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.drawArrays(gl.POINTS, 0, texels.length);
  }

  begin(target) {
    const gl = this.gl;
    for (const feature of [gl.DEPTH_TEST, gl.CULL_FACE, gl.BLEND, gl.SCISSOR_TEST]) gl.disable(feature);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, this.width, this.height);
  }

  advance(substeps, dt, coefficients, {speed}) {
    const gl = this.gl;
    if (coefficients !== this.uploaded) {
      const padded = new Float32Array(4 * this.width * this.height);
      padded.set(coefficients);
      this.upload(this.coefficients, 4, padded);
      this.uploaded = coefficients;
    }
    gl.useProgram(this.program.program);
    gl.bindVertexArray(this.none);
    [null, this.links, this.coefficients, this.load, this.accelerations].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    this.program.set({
      state: 0,
      links: 1,
      coefficients: 2,
      load: 3,
      acceleration: 4,
      linkCount: this.most,
      height: this.height,
      tension: speed ** 2,
      ratio: this.law.ratio,
    });
    for (let step = 0; step < substeps; step++) {
      this.program.set({before: step ? 0 : dt / 2, after: step < substeps - 1 ? dt : dt / 2});
      this.begin(this.targets[1]);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.states[0]);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      this.states.reverse();
      [this.targets[0], this.targets[1]] = [this.targets[1], this.targets[0]];
    }
    this.current = false;
  }

  free() {
    const gl = this.gl;
    for (const texture of [...this.states, this.load, this.coefficients, this.links, this.accelerations])
      gl.deleteTexture(texture);
    for (const target of this.targets) gl.deleteFramebuffer(target);
  }
}
