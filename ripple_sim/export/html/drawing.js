// Draws a frame with WebGL 2: shadow map, shadows on the floor, surfaces, floor and background,
// transparent surfaces, arrows. Where pixels are drawn by software, edges are smoothed afterwards:
// samples would cost more; with alpha, the canvas is copied for nothing.
const HEATED = [0.62, 0.62, 0.62]; // colour of the lit surface under the colours of heights
// Least opacity, and opacity up to which texels of a texture are drawn: those that are more than
// half opaque, where a texture has no others; opaque ones; and those that show what is behind them.
const HALF_OPAQUE = [0.5, 2];
const OPAQUE = [0.95, 2];
const CLEAR = [0.02, 0.95];
const SHADOW_CELL = 3; // texels of the shadow map between the points of surfaces in it

class Drawing {
  constructor(canvas, meta) {
    const software = drawsInSoftware();
    const gl = canvas.getContext("webgl2", {
      antialias: !software,
      preserveDrawingBuffer: true,
      alpha: software,
    });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, {gl, canvas, meta, software});
    this.shadowSize = software ? 384 : 1024;
    this.makePrograms();
    this.images = {};
    this.blank = colorsTexture(gl, [[255, 255, 255]]);
    this.heat = colorsTexture(gl, meta.heat);
    this.environment = new Environment(
      gl,
      meta.light.boxes,
      meta.light.studio ? 1 : 0.5,
      meta.light.studio ? 1 : 0,
    );
    const cell = (SHADOW_CELL * SHADOW_WIDTH * meta.distance) / this.shadowSize;
    this.parts = meta.parts.map(part => partOf(gl, part, cell));
    this.drawn = grouped(gl, this.parts);
    this.arrow = partOf(gl, arrowPart(), cell);
    const sides = [this.shadowSize, this.shadowSize];
    this.shadow = tableOf(gl, "DEPTH_COMPONENT24", ...sides, {
      ...LINEAR,
      COMPARE_MODE: "COMPARE_REF_TO_TEXTURE",
    });
    this.blockers = tableOf(gl, "RG8", ...sides, {...LINEAR, MIN_FILTER: "LINEAR_MIPMAP_LINEAR"}, 8);
    this.target = framebufferOf(gl, {DEPTH_ATTACHMENT: this.shadow, COLOR_ATTACHMENT0: this.blockers});
    this.shades = tableOf(gl, "R8", this.shadowSize / 2, this.shadowSize / 2, LINEAR);
    this.shadeTarget = framebufferOf(gl, {COLOR_ATTACHMENT0: this.shades});
    this.smoothing = software && new Smoothing(gl, canvas);
  }

  async load() {
    for (const [id, uri] of Object.entries(this.meta.images)) {
      const image = new Image();
      image.src = uri;
      await image.decode();
      this.images[id] = imageTexture(this.gl, image, this.software);
    }
    for (const part of this.parts)
      part.lit = this.software && part.target && !this.imageOf(part) ? new LitPoints(this.gl, part) : null;
  }

  makePrograms() {
    const {
      gl,
      meta: {
        light: {lamps},
        floor,
      },
      shadowSize,
    } = this;
    const near = lamps.some(lamp => lamp.position);
    const told = {lamps, near, taps: this.software ? 2 : 5, shadowSize};
    const light = lightShader(told);
    const lit = litShader(told);
    const onFloor = floorShader(told);
    const plain = floor && !(floor.texture in this.meta.images) && !near;
    this.floor =
      floor && new Floor(gl, floor, [floorVertex(light, onFloor), floorFragment(light, onFloor)], plain);
    this.sky = programOf(gl, EVERYWHERE_VERTEX, skyFragment(light));
    this.depth = programOf(gl, DEPTH_VERTEX, DEPTH_FRAGMENT);
    this.shading = programOf(gl, DEPTH_VERTEX, SHADE_FRAGMENT, [`SIZE ${shadowSize}.0`]);
    this.triangles = programOf(gl, LIT_POINTS_VERTEX, LIT_POINTS_FRAGMENT);
    this.shaders = {
      surface: [SURFACE_VERTEX, surfaceFragment(light, lit)],
      points: [EVERYWHERE_VERTEX, pointsFragment(light, litShader({...told, taps: 4}))],
    };
    this.known = new Map();
  }

  // The program that lights pixels or, as `kind` tells, points.
  lighting(kind, {coat}, image, glow, heat) {
    const features = {COAT: coat, TEXTURED: image, GLOWS: glow, HEAT: heat};
    const defined = Object.keys(features).filter(name => features[name]);
    const key = [kind, ...defined].join(" ");
    if (!this.known.has(key)) this.known.set(key, programOf(this.gl, ...this.shaders[kind], defined));
    return this.known.get(key);
  }

  imageOf(part) {
    return this.images[part.texture];
  }

  // Draws a target from now on as `displace` left it.
  upload(part) {
    const gl = this.gl;
    for (const i of [0, 1, 3]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, part.buffers[i]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, part.data[i]);
    }
  }

  // With what `view` and `bodies` say of the camera and the bodies' places; arrows are matrices;
  // `heat`: targets show their heights; `fine`: their pixels are lit, where else it is their points.
  // Everything is uploaded before anything is drawn, which would wait for it.
  draw(view, bodies, arrows, heat, fine) {
    const gl = this.gl;
    this.fine = fine;
    const light = lightOf(this.meta, view, this.environment.diffuse([0, 0, 1]), this.shadowSize);
    const parts = this.placed(bodies, view.eye);
    const casters = parts.filter(({part}) => part.opacity === 1);
    const floor = this.meta.floor && this.setFloor(view, bodies, light, casters);
    this.shared = {
      ...light,
      eye: view.eye,
      viewProjection: view.matrix,
      shadowMap: 0,
      image: 1,
      heatColors: 2,
      places: 3,
      normals: 4,
      ambientMap: 5,
      coatMap: 6,
      mirrorMap: 7,
      shades: 8,
      glowImage: 9,
      floorPlane: floor ? planeOf(floor.floorFrame) : [0, 0, 0, 0],
    };
    this.ready = new Set(); // programs that have these
    this.heated = heat;
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    this.drawShadows(casters, light, floor);
    this.bind(8, this.shades);
    this.bind(0, this.shadow);
    this.bind(2, this.heat);
    this.bind(5, this.environment.ambient);
    this.bind(6, this.environment.mirrored(COAT_ROUGHNESS));
    gl.disable(gl.DEPTH_TEST);
    for (const {part, model} of parts) if (this.isLitByPoints(part)) this.lightPoints(part, model);
    gl.enable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clear(gl.DEPTH_BUFFER_BIT | gl.COLOR_BUFFER_BIT);
    for (const each of parts) if (each.opacity === 1) this.drawPart(each);
    this.drawScreen(view, floor);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const each of parts) {
      if (each.opacity < 1) this.drawPart(each);
      else if (this.isClear(each.part)) this.drawClear(each);
    }
    gl.disable(gl.BLEND);
    for (const model of arrows) this.drawPart({part: this.arrow, model});
    if (this.smoothing) this.smooth(bodies, view, arrows);
  }

  // Whether a target's points are lit in this frame, and not its pixels.
  isLitByPoints(part) {
    return Boolean(part.lit) && !this.fine;
  }

  // Lights the points of a target for `drawPart`.
  lightPoints(part, model) {
    this.bind(3, part.lit.places);
    this.bind(4, part.lit.normals);
    this.look("points", part, model);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, part.lit.target);
    this.gl.viewport(0, 0, COLUMNS, part.lit.rows);
    this.cover();
  }

  // Smooths the edges of the parts and of the arrows; everything where the floor's rim is seen.
  smooth(bodies, view, arrows) {
    const parts = this.parts.map(part => ({part, model: times(bodies[part.body], part.local)}));
    for (const model of arrows) parts.push({part: this.arrow, model});
    this.smoothing.draw(parts, view.matrix, this.floor && this.floor.ends);
  }

  // Parts with their places, the most opaque first.
  placed(bodies, eye) {
    return this.drawn
      .map(part => {
        const model = part.parts ? IDENTITY : times(bodies[part.body], part.local);
        if (part.parts) part.place(bodies, eye);
        if (this.isLitByPoints(part)) part.lit.place(model, eye);
        return {part, model, opacity: part.opacity * (1 - 0.6 * part.transparency)};
      })
      .sort((a, b) => b.opacity - a.opacity);
  }

  // The floor's cells, and its uniforms.
  setFloor(view, bodies, light, casters) {
    const floor = this.meta.floor;
    const fade = this.meta.light.studio ? [0.4, 3.4] : [1.5, 10];
    const floorFrame = times(bodies[floor.body], placed(floor.position, floor.quaternion));
    this.floor.set(view, floorFrame, light, casters, 1.5 * fade[1] * view.distance);
    return {
      focus: view.focus,
      fade: [...fade, view.distance],
      floorFrame,
      floorColor: floor.color,
      floorTiling: floor.tiling,
    };
  }

  drawShadows(casters, {shadowMatrix, softness}, floor) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, this.shadowSize, this.shadowSize);
    gl.clear(gl.DEPTH_BUFFER_BIT | gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.depth.program);
    for (const {part, model} of casters) {
      this.depth.set({modelProjection: times(shadowMatrix, model)});
      this.mesh(part, part.shadow);
    }
    this.bind(8, this.blockers);
    gl.generateMipmap(gl.TEXTURE_2D);
    if (!floor) return;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadeTarget);
    gl.viewport(0, 0, this.shadowSize / 2, this.shadowSize / 2);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.shading.program);
    this.shading.set({modelProjection: times(shadowMatrix, floor.floorFrame), blockers: 8, softness});
    this.floor.drawCells(1);
  }

  // Whether a part is drawn with an image that has texels which are neither opaque nor clear.
  isClear(part) {
    return part.clear && part.opacity === 1 && this.imageOf(part) && !(this.heated && part.target);
  }

  // The nearest of a part's texels that are neither opaque nor clear: depths first, then colours.
  drawClear(each) {
    const gl = this.gl;
    gl.depthFunc(gl.LEQUAL);
    gl.colorMask(false, false, false, false);
    this.drawPart(each, CLEAR);
    gl.colorMask(true, true, true, true);
    this.drawPart(each, CLEAR);
    gl.depthFunc(gl.LESS);
  }

  drawPart({part, model}, texels = this.isClear(part) ? OPAQUE : HALF_OPAQUE) {
    const byPoints = this.isLitByPoints(part);
    if (byPoints) {
      this.bind(3, part.lit.colors);
      this.gl.useProgram(this.triangles.program);
      this.triangles.set({modelProjection: times(this.shared.viewProjection, model), colors: 3});
    } else {
      this.look("surface", part, model, texels);
    }
    const drawn = byPoints ? part.lit : part;
    this.mesh(drawn, drawn.all);
  }

  // The program that lights a part, with its look.
  look(kind, part, model, texels = HALF_OPAQUE) {
    const heat = this.heated && part.target;
    const image = heat ? null : this.imageOf(part);
    const glow = heat ? null : this.images[part.glow];
    const color = heat ? HEATED : part.color;
    this.bind(1, image || this.blank);
    if (glow) this.bind(9, glow);
    this.bind(7, this.environment.mirrored(Math.max(part.roughness, 0.0632)));
    if (color) this.gl.vertexAttrib3fv(COLOR, color);
    this.use(this.lighting(kind, part, image, glow, heat), {
      model,
      open: Number(part.open),
      texels,
      ...(color && {color}),
      base: [part.roughness, part.metallic, part.sheen, part.coat],
      volume: [part.translucency, part.transparency, part.emission, part.opacity],
    });
  }

  bind(unit, texture) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
  }

  // Makes a program the present one, with what all have in common in this frame.
  use(program, uniforms = {}) {
    this.gl.useProgram(program.program);
    if (!this.ready.has(program)) {
      this.ready.add(program);
      program.set(this.shared);
    }
    program.set(uniforms);
  }

  mesh(part, {buffer, count}) {
    const gl = this.gl;
    part.open ? gl.disable(gl.CULL_FACE) : gl.enable(gl.CULL_FACE);
    gl.bindVertexArray(part.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
  }

  // The floor, which fades into the sky, and the sky.
  drawScreen(view, floor) {
    const gl = this.gl;
    gl.disable(gl.CULL_FACE);
    if (floor) {
      this.bind(1, this.imageOf(this.meta.floor) || this.blank);
      this.floor.draw(program => this.use(program, floor));
    }
    const bare = floor ? this.floor.bare : [-1, 1];
    const {width, height} = this.canvas;
    if (!bare) return;
    const [low, high] = bare.map(y => ((y + 1) / 2) * height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, Math.floor(low), width, Math.ceil(high) - Math.floor(low));
    this.use(this.sky, {rayMiddle: view.ray[0], rayRight: view.ray[1], rayUp: view.ray[2]});
    this.cover();
    gl.disable(gl.SCISSOR_TEST);
  }

  // Draws everywhere with the present program.
  cover() {
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }
}

// The plane of a frame's first two axes: its normal, and how high it lies along that.
function planeOf(frame) {
  const up = frame.slice(8, 11);
  return [...up, dot(up, frame.slice(12, 15))];
}
