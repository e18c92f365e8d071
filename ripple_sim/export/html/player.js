// The player: time, camera and controls. Tests and other pages may use `ripplePlayer`.
const ARROW_LENGTH = 0.25;  // of the strongest contact, in distances of the camera
const RATE = 30, LATE = 1.1, COARSEST = 0.6;  // frames a second that it takes care to show, by how much they may be late before fewer pixels are drawn, and how few
const REFRESH = 17;  // of the screen [ms]

function arrowPart() {
  const points = [], normals = [], F = [], sides = 10;
  for (let i = 0; i < sides; i++) {
    const a = 2 * Math.PI * i / sides, [x, y] = [Math.cos(a), Math.sin(a)], k = 5 * i, l = 5 * ((i + 1) % sides);
    points.push(x * 0.03, y * 0.03, -1, x * 0.03, y * 0.03, -0.25, x * 0.09, y * 0.09, -0.25, 0, 0, 0, 0, 0, -1);
    normals.push(x, y, 0, x, y, 0, x, y, 0.4, x, y, 0.4, 0, 0, -1);
    F.push(k, l, k + 1, l, l + 1, k + 1, k + 2, l + 2, k + 3, k + 1, l + 1, l + 2, k + 1, l + 2, k + 2, k, k + 4, l);
  }
  return {rest: points, directions: normals, F, points: 5 * sides, uv: null, position: [0, 0, 0], quaternion: [1, 0, 0, 0], open: true,
    color: [0.85, 0.08, 0.05], roughness: 0.6, metallic: 0, sheen: 0, coat: 0, translucency: 0, transparency: 0, emission: 0.4, opacity: 1, texture: -1};
}

class Player {
  constructor(canvas) {
    this.canvas = canvas; this.number = 0; this.playing = true; this.shown = 0; this.heat = false; this.contacts = false; this.detail = 1;
    this.orbit = null;  // azimuth and elevation [radians], distance and focus; null: the scene's camera
    this.meta = JSON.parse(document.getElementById("meta").textContent);
  }

  async start() {
    readArrays(this.meta.parts, await bytesOf(document.getElementById("arrays").textContent));
    this.targets = this.meta.parts.filter(part => part.target);
    this.frames = new Frames(this.meta, this.targets);
    this.drawing = new Drawing(this.canvas, this.meta);
    await this.drawing.load();
    this.limits = this.targets.map(() => 1);
    this.strongest = 1e-9;
    await this.show(0);
  }

  // Draws a frame at once; returns when it is on the canvas.
  async show(number) {
    this.number = Math.max(0, Math.min(number, this.frames.count - 1));
    this.frame = await this.frames.get(Math.floor(this.number));
    this.targets.forEach((part, i) => {
      const steps = this.frame.steps[i], V = this.frame.vertices[i], step = this.meta.steps[i];
      this.limits[i] = steps.reduce((most, step) => Math.max(most, Math.abs(step)), this.limits[i]);
      displace(part, V ? this.frames.motions.get(String(i)).at(V) : part, steps, step, 0.8 * this.limits[i] * step);
      this.drawing.upload(part);
    });
    this.onCanvas = Math.floor(this.number);
    this.redraw();
    this.shown++;
  }

  redraw() {
    if (!this.frame) return;
    const scale = (window.devicePixelRatio || 1) * (this.playing ? this.detail : 1);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map(x => Math.max(1, Math.round(x * scale)));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    const bodies = this.frame.pose.slice(1).map(row => placed(row.slice(0, 3), row.slice(3)));
    this.drawing.draw(this.view(width / height), bodies, this.contacts ? this.arrows() : [], this.heat);
  }

  arrows() {
    for (const arrow of this.frame.arrows) this.strongest = Math.max(this.strongest, Math.abs(arrow[6]));
    return this.frame.arrows.map(([x, y, z, nx, ny, nz, impulse]) => {
      const length = ARROW_LENGTH * this.meta.distance * Math.sqrt(Math.abs(impulse) / this.strongest);
      const way = unit([nx, ny, nz]), side = unit(cross(Math.abs(way[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1], way)), up = cross(way, side);
      return [...scaled(side, length), 0, ...scaled(up, length), 0, ...scaled(way, length), 0, x, y, z, 1];
    });
  }

  view(aspect) {
    const [camera] = this.frame.pose, m = placed(camera.slice(0, 3), camera.slice(3));
    let [right, up, back, eye] = [m.slice(0, 3), m.slice(4, 7), m.slice(8, 11), camera.slice(0, 3)];
    let distance = this.meta.distance, focus = add(eye, back, -distance);
    if (this.orbit) {
      const {azimuth, elevation} = this.orbit;
      ({distance, focus} = this.orbit);
      back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
      right = unit([-back[1], back[0], 0]);
      up = cross(back, right);
      eye = add(focus, back, distance);
    }
    const half = Math.tan(this.meta.fovy * Math.PI / 360), near = 0.02 * distance, far = 100 * distance;
    return {eye, right, up, back, focus, distance, ray: [scaled(back, -1), scaled(right, half * aspect), scaled(up, half)],
      matrix: times(perspective(this.meta.fovy, aspect, near, far), viewOf(eye, right, up, back))};
  }

  // Takes the camera over from the scene.
  free() {
    if (this.orbit) return;
    const {back, focus, distance} = this.view(1);
    this.orbit = {azimuth: Math.atan2(back[1], back[0]), elevation: Math.asin(Math.max(-1, Math.min(1, back[2]))), distance, focus};
  }
}

function control(player) {
  const of = id => document.getElementById(id), slider = of("frame"), canvas = player.canvas;
  const follow = () => { slider.max = player.frames.count - 1; slider.value = player.number; of("time").textContent = `${(player.number / player.meta.fps).toFixed(2)} s`; };
  const play = on => { player.playing = on; player.redraw(); of("play").textContent = on ? "Pause" : "Play"; };
  of("play").onclick = () => play(!player.playing);
  slider.oninput = async () => { play(false); await player.show(Number(slider.value)); follow(); };
  for (const id of ["heat", "contacts"]) of(id).onchange = event => { player[id] = event.target.checked; player.redraw(); };
  of("camera").onclick = () => { player.orbit = null; player.redraw(); };
  canvas.onpointerdown = event => canvas.setPointerCapture(event.pointerId);
  canvas.onpointermove = event => {
    if (!event.buttons) return;
    player.free();
    const orbit = player.orbit, step = 0.006;
    if (event.shiftKey || event.buttons > 1) {
      const {right, up} = player.view(1), scale = 1.5 * orbit.distance / canvas.clientHeight;
      orbit.focus = add(add(orbit.focus, right, -scale * event.movementX), up, scale * event.movementY);
    } else {
      orbit.azimuth -= step * event.movementX;
      orbit.elevation = Math.max(-1.55, Math.min(1.55, orbit.elevation + step * event.movementY));
    }
    player.redraw();
  };
  canvas.onwheel = event => { event.preventDefault(); player.free(); player.orbit.distance *= Math.exp(0.001 * event.deltaY); player.redraw(); };
  document.onkeydown = event => { if (event.key === " ") { event.preventDefault(); play(!player.playing); } };
  window.onresize = () => player.redraw();
  let last = performance.now(), drawn = last, late = 1;
  const tick = async now => {
    const speed = Number(of("speed").value) * player.meta.fps, count = player.frames.count;
    const next = player.number + (now - last) / 1000 * speed;
    last = now;
    if (player.playing) {
      player.number = document.getElementById("end") && next >= count ? 0 : next;
      // a frame that is on the canvas already is not drawn again
      if (Math.floor(player.number) !== player.onCanvas) {
        late += 0.03 * (Math.min((now - drawn) / Math.max(1000 / speed, 1000 / RATE), 3) - late);
        if (late > LATE && player.detail > COARSEST) { player.detail *= 0.8; late = 1; }
        drawn = now;
        await player.show(player.number);
        follow();
      }
    }
    // where the next frame is far off, the browser may rest
    const rest = 1000 * (1 - player.number % 1) / speed - REFRESH;
    setTimeout(() => requestAnimationFrame(tick), player.playing ? Math.max(Math.min(rest, 100), 0) : 0);
  };
  follow();
  requestAnimationFrame(tick);
}

const player = new Player(document.getElementById("view"));
window.ripplePlayer = {player, ready: player.start().then(() => { control(player); return player; })};
