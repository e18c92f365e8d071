"use strict";
// Draws a frame with WebGL 2: shadow map, surfaces, floor and background, transparent surfaces, arrows.

class Drawing {
  constructor(canvas, meta) {
    const software = drawsInSoftware();
    const gl = canvas.getContext("webgl2", {antialias: !software, preserveDrawingBuffer: true, alpha: false});
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl; this.canvas = canvas; this.meta = meta; this.software = software;
    this.shadowSize = software ? 512 : 1024;
    const lamps = meta.light.lamps;
    this.defines = `#version 300 es\n#define LAMPS ${lamps.length}\n#define NEAR ${Number(lamps.some(lamp => lamp.position))}\n#define TAPS ${software ? 2 : 5}\n#define SHADOW_SIZE ${this.shadowSize}.0\n`;
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.fine = software ? this.program(FINE_VERTEX, FINE_FRAGMENT) : this.surface;
    this.depth = this.program(DEPTH_VERTEX, DEPTH_FRAGMENT);
    this.floor = this.program(FLOOR_VERTEX, FLOOR_FRAGMENT);
    this.sky = this.program(SKY_VERTEX, SKY_FRAGMENT);
    this.empty = gl.createVertexArray();
    this.images = {};
    this.blank = this.texture([[255, 255, 255]]);
    this.heat = this.texture(meta.heat);
    this.parts = meta.parts.map(part => this.part(part));
    this.arrow = this.part(arrowPart());
    this.shadow = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.shadow);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, this.shadowSize, this.shadowSize);
    for (const [name, value] of [["MIN_FILTER", "LINEAR"], ["MAG_FILTER", "LINEAR"], ["COMPARE_MODE", "COMPARE_REF_TO_TEXTURE"]])
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
    this.target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.shadow, 0);
  }

  async load() {
    for (const [id, uri] of Object.entries(this.meta.images)) {
      const image = new Image();
      image.src = uri;
      await image.decode();
      this.images[id] = this.texture(image);
    }
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source.startsWith("#version") ? source : this.defines + source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {}, kinds = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const {name, type} = gl.getActiveUniform(program, i), short = name.replace("[0]", "");
      places[short] = gl.getUniformLocation(program, name);
      kinds[short] = type;
    }
    const setters = {[gl.FLOAT]: "uniform1fv", [gl.FLOAT_VEC2]: "uniform2fv", [gl.FLOAT_VEC3]: "uniform3fv", [gl.FLOAT_VEC4]: "uniform4fv"};
    const set = values => {
      for (const [name, value] of Object.entries(values)) {
        if (places[name] === undefined) continue;
        if (kinds[name] === gl.FLOAT_MAT4) gl.uniformMatrix4fv(places[name], false, value);
        else if (setters[kinds[name]]) gl[setters[kinds[name]]](places[name], [value].flat(2));
        else gl.uniform1i(places[name], value);
      }
    };
    return {program, set};
  }

  // An image, or a row of colours.
  texture(source) {
    const gl = this.gl, texture = gl.createTexture(), row = Array.isArray(source);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    if (row) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, source.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(source.flatMap(c => [...c, 255])));
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, source);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, row ? gl.LINEAR : this.software ? gl.LINEAR_MIPMAP_NEAREST : gl.LINEAR_MIPMAP_LINEAR);
    for (const side of ["S", "T"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${side}`], row ? gl.CLAMP_TO_EDGE : gl.REPEAT);
    return texture;
  }

  // Buffers of a part: a drawn vertex for each point, or for each point and place in the texture.
  part(part) {
    const gl = this.gl, index = new Uint32Array(part.F.length), of = [], uv = [];
    if (part.uv) {
      const known = new Map();
      part.F.forEach((point, corner) => {
        const key = `${point} ${part.uv[2 * corner]} ${part.uv[2 * corner + 1]}`;
        if (!known.has(key)) { known.set(key, of.length); of.push(point); uv.push(part.uv[2 * corner], 1 - part.uv[2 * corner + 1]); }
        index[corner] = known.get(key);
      });
    } else index.set(part.F);
    const count = part.uv ? of.length : part.points, source = part.uv ? Uint32Array.from(of) : Uint32Array.from({length: count}, (_, i) => i);
    const array = gl.createVertexArray(), buffers = [3, 3, 2, 1].map(() => gl.createBuffer());
    gl.bindVertexArray(array);
    const data = [new Float32Array(3 * count), new Float32Array(3 * count), uv.length ? Float32Array.from(uv) : new Float32Array(2 * count), new Float32Array(count)];
    source.forEach((point, i) => { for (let k = 0; k < 3; k++) { data[0][3 * i + k] = part.rest[3 * point + k]; data[1][3 * i + k] = part.directions[3 * point + k]; } });
    [3, 3, 2, 1].forEach((size, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[i]);
      gl.bufferData(gl.ARRAY_BUFFER, data[i], part.target && i !== 2 ? gl.DYNAMIC_DRAW : gl.STATIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 0, 0);
    });
    const [all, facing] = [gl.createBuffer(), gl.createBuffer()];
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, facing);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, part.target ? 4 * index.length : 0, gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, all);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return {...part, array, buffers, data, source, index, all, facing, local: placed(part.position, part.quaternion)};
  }

  // Displaces a target from its rest by heights in steps [m]; normals are those of the triangles round a point, creases stay.
  displace(part, {rest, directions}, steps, step, limit) {
    const gl = this.gl, {F, source, data} = part, count = part.points;
    const points = new Float32Array(3 * count), normals = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) for (let k = 0; k < 3; k++) points[3 * i + k] = rest[3 * i + k] + steps[i] * step * directions[3 * i + k];
    for (let t = 0; t < F.length; t += 3) {
      const a = 3 * F[t], b = 3 * F[t + 1], c = 3 * F[t + 2];
      const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
      const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      for (const p of [a, b, c]) { normals[p] += x; normals[p + 1] += y; normals[p + 2] += z; }
    }
    for (let i = 0; i < source.length; i++) {
      const p = 3 * source[i], size = Math.hypot(normals[p], normals[p + 1], normals[p + 2]) || 1;
      for (let k = 0; k < 3; k++) { data[0][3 * i + k] = points[p + k]; data[1][3 * i + k] = normals[p + k] / size; }
      data[3][i] = steps[source[i]] * step / limit;
    }
    for (const i of [0, 1, 3]) { gl.bindBuffer(gl.ARRAY_BUFFER, part.buffers[i]); gl.bufferSubData(gl.ARRAY_BUFFER, 0, data[i]); }
  }

  // Puts the triangles of a closed target that face the eye into a buffer, and returns how many indices they have: software
  // would light the points of the others, too.
  face(part, model, eye) {
    const gl = this.gl, {index, data: [points]} = part, facing = new Uint32Array(index.length), off = add(eye, model.slice(12, 15), -1);
    const [x, y, z] = [0, 4, 8].map(column => dot(model.slice(column, column + 3), off));
    let count = 0;
    for (let t = 0; t < index.length; t += 3) {
      const a = 3 * index[t], b = 3 * index[t + 1], c = 3 * index[t + 2], px = points[a], py = points[a + 1], pz = points[a + 2];
      const ux = points[b] - px, uy = points[b + 1] - py, uz = points[b + 2] - pz, vx = points[c] - px, vy = points[c + 1] - py, vz = points[c + 2] - pz;
      if ((uy * vz - uz * vy) * (x - px) + (uz * vx - ux * vz) * (y - py) + (ux * vy - uy * vx) * (z - pz) > 0)
        for (let k = 0; k < 3; k++) facing[count++] = index[t + k];
    }
    gl.bindVertexArray(part.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.facing);
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, facing.subarray(0, count));
    return count;
  }

  draw(view, bodies, arrows, heat) {
    const gl = this.gl, {width, height} = this.canvas;
    const models = this.parts.map(part => times(bodies[part.body], part.local));
    const light = lightOf(this.meta, view, bodies, this.shadowSize);
    gl.enable(gl.DEPTH_TEST); gl.depthMask(true); gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, this.shadowSize, this.shadowSize);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.share(this.depth, {viewProjection: light.shadowMatrix});
    this.parts.forEach((part, i) => { if (part.opacity === 1) this.mesh(this.depth, part, {model: models[i]}); });
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT | gl.COLOR_BUFFER_BIT);
    this.bind(0, this.shadow); this.bind(2, this.heat);
    const shared = {...light, eye: view.eye, viewProjection: view.matrix, shadowMap: 0, image: 1, heatColors: 2};
    for (const program of new Set([this.fine, this.surface, this.floor, this.sky])) this.share(program, shared);
    const order = this.parts.map((part, i) => [part, models[i], part.opacity * (1 - 0.6 * part.transparency)]).sort((a, b) => b[2] - a[2]);
    let solid = true;
    for (const [part, model, opacity] of order) {
      if (solid && opacity < 1) { solid = false; this.screen(view, bodies); this.blend(); }
      const textured = part.texture in this.images, fine = part.target && !textured, program = fine ? this.fine : this.surface;
      const count = fine && this.software && !part.open ? this.face(part, model, view.eye) : 0;
      this.bind(1, this.images[part.texture] || this.blank);
      gl.useProgram(program.program);
      this.mesh(program, part, {...lookOf(part), model, heat: heat && part.target ? 1 : 0, textured: Number(textured), open: Number(part.open)}, count);
    }
    if (solid) this.screen(view, bodies);
    gl.useProgram(this.surface.program);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    for (const model of arrows) this.mesh(this.surface, this.arrow, {...lookOf(this.arrow), model, heat: 0, textured: 0});
  }

  blend() {
    const gl = this.gl;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  bind(unit, texture) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
  }

  // Sets what all meshes of a frame have in common.
  share(program, uniforms) {
    this.gl.useProgram(program.program);
    program.set(uniforms);
  }

  // Draws a part, or those of its triangles that face the eye: so many indices.
  mesh(program, part, uniforms, facing = 0) {
    const gl = this.gl;
    part.open ? gl.disable(gl.CULL_FACE) : gl.enable(gl.CULL_FACE);
    program.set(uniforms);
    gl.bindVertexArray(part.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, facing ? part.facing : part.all);
    gl.drawElements(gl.TRIANGLES, facing || part.index.length, gl.UNSIGNED_INT, 0);
  }

  // The floor, which fades into the sky, and the sky.
  screen(view, bodies) {
    const gl = this.gl, floor = this.meta.floor, fade = this.meta.light.studio ? [0.4, 3.4] : [1.5, 10];
    gl.bindVertexArray(this.empty);
    gl.disable(gl.CULL_FACE);
    if (floor && view.back[2] > -1) {
      gl.useProgram(this.floor.program);
      this.bind(1, this.images[floor.texture] || this.blank);
      this.floor.set({focus: view.focus, fade: [...fade, view.distance], reach: 1.5 * fade[1] * view.distance, floorTiling: floor.tiling,
        floorFrame: times(bodies[floor.body], placed(floor.position, floor.quaternion)), floorColor: floor.color,
        floorTextured: floor.texture in this.images ? 1 : 0, floorHalf: floor.half.map(x => x || 1e9)});
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.useProgram(this.sky.program);
    this.sky.set({rayMiddle: view.ray[0], rayRight: view.ray[1], rayUp: view.ray[2]});
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

// Whether WebGL runs on the processor, where every pixel costs.
function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2"), info = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return info ? /swiftshader|llvmpipe|software/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : false;
}

const lookOf = part => ({color: part.color, base: [part.roughness, part.metallic, part.sheen, part.coat],
  volume: [part.translucency, part.transparency, part.emission, part.opacity]});
