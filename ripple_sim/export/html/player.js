// The player: the run in time, its waves, and the picture. Tests and other pages may use `ripplePlayer`.
const ARROW_LENGTH = 0.25; // of the strongest contact, in distances of the camera
const WIDEST_KEPT = 1.4; // aspect of the scene's picture that is wholly in view on a tall screen
const COLOR_SHARE = 0.8; // of the greatest height so far, which has the strongest colours

class Player {
  constructor(canvas) {
    Object.assign(this, {
      canvas,
      number: 0,
      playing: true,
      shown: 0,
      heat: false,
      contacts: false,
      grid: false,
      detail: new Detail(),
    });
    this.orbit = null; // azimuth and elevation [radians], distance and focus; null: the scene's camera
    this.poked = false;
    this.resting = false; // after the end, when no wave moves any more
    this.rival = null; // waves of another operator, which are shown beside
    this.meta = JSON.parse(document.getElementById("meta").textContent);
    this.work = Promise.resolve(); // what goes through time, one after the other
  }

  async start() {
    readArrays(this.meta.parts, await bytesOf(document.getElementById("arrays").textContent));
    this.targets = this.meta.parts.filter(part => part.target);
    this.frames = this.meta.stream
      ? new StreamedFrames(this.meta, this.targets)
      : new Frames(this.meta, this.targets);
    await this.frames.load();
    // of frames that arrive: the latest, and whether it is shown
    Object.assign(this, {newest: 0, following: true});
    this.drawing = new Drawing(this.canvas, this.meta);
    await this.drawing.load();
    this.surfaces = await Promise.all(this.targets.map((part, target) => surfaceOf(part, target)));
    this.chooseSolvers();
    this.timeline = new Timeline(this.frames, this.surfaces);
    const least = 1e-4 * this.meta.distance;
    this.limits = this.targets.map((_, i) => (this.surfaces[i] ? least : this.meta.steps[i]));
    this.strongest = 1e-9;
    await this.show(0);
  }

  // The graphics card was lost, as on a sleeping phone: the loop has the waves as they were last drawn.
  lose() {
    this.drawing.lost = true;
    for (const surface of this.allSurfaces) {
      surface.solver.current = true;
      surface.use(new WaveLoop(surface.law));
    }
  }

  // It came back: everything that was on it is made anew.
  async regain() {
    const drawing = new Drawing(this.canvas, this.meta);
    await drawing.load();
    this.drawing = drawing;
    for (const surface of this.allSurfaces) surface.grid = null;
    this.chooseSolvers();
    await this.paint();
  }

  // Whether the page solves the waves of any target.
  get live() {
    return this.surfaces.some(Boolean);
  }

  // The surfaces that it solves, with the rival's.
  get allSurfaces() {
    return [...this.surfaces, ...(this.rival ? this.rival.surfaces : [])].filter(Boolean);
  }

  // Solves the waves in the way that is faster here, or by "loop" or "pass".
  chooseSolvers(kind) {
    this.allSurfaces.forEach(surface => this.chooseSolver(surface, kind));
  }

  chooseSolver(surface, kind) {
    const {gl, software} = this.drawing;
    const loop = kind === "loop" || (!kind && software) || passFault(gl, surface.law);
    const solver = loop
      ? new WaveLoop(surface.law)
      : kind
        ? new WavePass(surface.law, gl)
        : fasterSolver(surface.law, gl);
    if (solver) surface.use(solver);
  }

  // Takes over the law of a surface whose material or state has changed.
  async replaceSurface(target, meta) {
    const before = this.surfaces[target];
    const surface = await surfaceOf(this.targets[target], target, meta);
    if (before) before.solver.free();
    this.surfaces[target] = surface;
    this.chooseSolver(surface, before ? before.solver.kind : undefined);
    this.timeline.forgetAll();
  }

  get isStill() {
    return !this.playing || this.resting;
  }

  // Draws a frame, or a moment between two, at once; returns when it is on the canvas.
  show(number) {
    this.work = this.work.then(async () => {
      this.resting = false;
      this.number = Math.max(this.frames.first || 0, Math.min(number, this.frames.count - 1));
      const reached = this.live ? this.number : Math.floor(this.number);
      await this.timeline.to(reached);
      if (this.rival) await this.rival.timeline.to(reached);
      await this.paint();
    });
    return this.work;
  }

  // Goes on after the end of the run for a time [s of the film].
  liveOn(seconds) {
    this.work = this.work.then(async () => {
      this.timeline.liveOn(seconds / this.meta.slowMotion);
      await this.paint();
    });
    return this.work;
  }

  restart() {
    this.work = this.work.then(() => this.timeline.restart());
    return this.show(0);
  }

  // Draws the present state.
  async paint() {
    this.frame = await this.frames.get(this.timeline.frame);
    this.next =
      this.timeline.frame + 1 < this.frames.count
        ? await this.frames.get(this.timeline.frame + 1)
        : this.frame;
    this.displaceBy(this.surfaces);
    this.onCanvas = Math.floor(this.number);
    this.redraw();
    this.shown++;
  }

  // Gives the targets the heights of surfaces, or the recorded ones.
  displaceBy(surfaces) {
    this.targets.forEach((part, i) => {
      const heights = this.heightsOf(i, surfaces[i]);
      const V = this.frame.vertices[i];
      this.limits[i] = heights.reduce((most, height) => Math.max(most, Math.abs(height)), this.limits[i]);
      displace(
        part,
        V ? this.frames.motions.get(String(i)).at(V) : part,
        heights,
        COLOR_SHARE * this.limits[i],
      );
      this.drawing.upload(part);
    });
  }

  // Heights of a target's points [m]: recorded heights, or heights of the waves that the page solves.
  heightsOf(target, surface) {
    const steps = this.frame.steps[target];
    if (steps) return Float32Array.from(steps, step => step * this.meta.steps[target]);
    surface.settle();
    return surface.pointHeights();
  }

  // Draws the present picture again, in all detail where it stands still.
  redraw() {
    if (!this.frame || this.drawing.lost) return;
    const scale = (window.devicePixelRatio || 1) * (this.isStill ? 1 : this.detail.share);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map(x =>
      Math.max(1, Math.round(x * scale)),
    );
    if (this.canvas.width !== width || this.canvas.height !== height)
      Object.assign(this.canvas, {width, height});
    if (this.rival) {
      this.displaceBy(this.rival.surfaces);
      this.drawOn(this.rival.surfaces);
      this.rival.copy(this.canvas);
      this.displaceBy(this.surfaces);
    }
    this.drawOn(this.surfaces);
  }

  // What was drawn last, with the rival's beside it.
  picture() {
    if (!this.rival) return this.canvas;
    const {width, height} = this.canvas;
    const both = Object.assign(document.createElement("canvas"), {width: 2 * width, height});
    const context = both.getContext("2d");
    context.drawImage(this.canvas, 0, 0);
    context.drawImage(this.rival.canvas, width, 0);
    return both;
  }

  // Draws what the targets show now, and the grids of their surfaces, on the canvas.
  drawOn(surfaces) {
    const view = this.view(this.canvas.width / this.canvas.height);
    const bodies = this.bodies();
    this.drawing.draw(view, bodies, this.contacts ? this.arrows() : [], this.heat, this.isStill);
    if (this.grid) this.drawGrids(surfaces, view, bodies);
  }

  drawGrids(surfaces, {matrix}, bodies) {
    surfaces.forEach(surface => {
      if (!surface) return;
      surface.grid = surface.grid || new TexelGrid(this.drawing.gl, surface.law);
      surface.grid.draw(
        times(matrix, times(bodies[surface.part.body], surface.part.local)),
        surface.solver.h,
      );
    });
  }

  // Position and quaternion of the camera and of the bodies, between two frames.
  places() {
    const share = this.timeline.share;
    if (!share) return this.frame.pose;
    return this.frame.pose.map((row, i) => between(row, this.next.pose[i], share));
  }

  bodies() {
    return this.places()
      .slice(1)
      .map(row => placed(row.slice(0, 3), row.slice(3)));
  }

  arrows() {
    for (const arrow of this.frame.arrows) this.strongest = Math.max(this.strongest, Math.abs(arrow[6]));
    return this.frame.arrows.map(([x, y, z, nx, ny, nz, impulse]) => {
      const length = ARROW_LENGTH * this.meta.distance * Math.sqrt(Math.abs(impulse) / this.strongest);
      const way = unit([nx, ny, nz]);
      const side = unit(cross(Math.abs(way[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1], way));
      const up = cross(way, side);
      return [...scaled(side, length), 0, ...scaled(up, length), 0, ...scaled(way, length), 0, x, y, z, 1];
    });
  }

  view(aspect) {
    const [camera] = this.places();
    const m = placed(camera.slice(0, 3), camera.slice(3));
    let [right, up, back, eye] = [m.slice(0, 3), m.slice(4, 7), m.slice(8, 11), camera.slice(0, 3)];
    let distance = this.meta.distance;
    let focus = add(eye, back, -distance);
    if (this.orbit) {
      const {azimuth, elevation} = this.orbit;
      ({distance, focus} = this.orbit);
      back = [
        Math.cos(elevation) * Math.cos(azimuth),
        Math.cos(elevation) * Math.sin(azimuth),
        Math.sin(elevation),
      ];
      right = unit([-back[1], back[0], 0]);
      up = cross(back, right);
      eye = add(focus, back, distance);
    }
    const fovy = this.fovy(aspect);
    const half = Math.tan((fovy * Math.PI) / 360);
    const near = 0.02 * distance;
    const far = 100 * distance;
    return {
      eye,
      right,
      up,
      back,
      focus,
      distance,
      ray: [scaled(back, -1), scaled(right, half * aspect), scaled(up, half)],
      matrix: times(perspective(fovy, aspect, near, far), viewOf(eye, right, up, back)),
    };
  }

  // The scene's angle of view from below to above [degrees]; a wider one on a tall screen, so that
  // as much is seen to the sides.
  fovy(aspect) {
    const wider = Math.max(1, Math.min(this.meta.aspect, WIDEST_KEPT) / aspect);
    return (360 / Math.PI) * Math.atan(wider * Math.tan((this.meta.fovy * Math.PI) / 360));
  }

  // Takes the camera over from the scene.
  free() {
    if (this.orbit) return;
    const {back, focus, distance} = this.view(1);
    this.orbit = {
      azimuth: Math.atan2(back[1], back[0]),
      elevation: Math.asin(Math.max(-1, Math.min(1, back[2]))),
      distance,
      focus,
    };
  }

  get aspect() {
    return this.canvas.clientWidth / this.canvas.clientHeight;
  }

  // From the camera through a place of the canvas, from -1 to 1 both.
  way(x, y) {
    const {ray} = this.view(this.aspect);
    return add(add(ray[0], ray[1], x), ray[2], y);
  }

  // The live surface at a place of the canvas, and the point in the frame of its geom; null beside them.
  pick(x, y) {
    const {eye} = this.view(this.aspect);
    const way = this.way(x, y);
    const bodies = this.bodies();
    const live = this.targets.filter((_, i) => this.surfaces[i] && !this.frame.steps[i]);
    const hit = touched(live, part => times(bodies[part.body], part.local), eye, way);
    return hit && {surface: this.surfaces[this.targets.indexOf(hit.part)], point: hit.point};
  }

  // Presses a surface at a point with a multiple of its typical hit. In the viewer the program does it.
  poke({surface, point}, strength) {
    this.poked = true;
    if (this.send) {
      this.send("poke", {target: this.surfaces.indexOf(surface), point, strength});
      return;
    }
    surface.press(pressedTexels(surface.law, point), strength * surface.pulse);
    this.timeline.forget();
  }
}

// The surface of a target whose law the page has, or null.
async function surfaceOf(part, target, changed) {
  const script = document.querySelector(`script.law[data-target="${target}"]`);
  if (!script && !changed) return null;
  const meta = changed || JSON.parse(script.textContent);
  const surface = new Surface(part, lawOf(meta, await bytesOf(meta.arrays)));
  const end = document.getElementById("end");
  const push = end ? JSON.parse(end.textContent).pushes[target] : 0;
  surface.pulse = push || meta.pulse;
  return surface;
}

// Between two rows of a position and a quaternion.
function between(row, next, share) {
  const way = dot(row.slice(3), next.slice(3)) < 0 ? -1 : 1;
  const mixed = row.map((x, i) => (1 - share) * x + share * next[i] * (i < 3 ? 1 : way));
  return [...mixed.slice(0, 3), ...unit(mixed.slice(3))];
}
