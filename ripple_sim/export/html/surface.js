// A surface whose waves the page solves: what acts on it, its steps, and its states.
const STILL = 1e-6; // heights and ways that nobody sees [sizes of the object]

class Surface {
  constructor(part, law) {
    Object.assign(this, {part, law, sliders: {...PLAIN}, coefficients: new Map()});
    this.heights = new TexelHeights(law);
    this.solver = new WaveLoop(law);
    this.restart();
  }

  // Solves the waves from now on with another solver, in the same state.
  use(solver) {
    const {h, v} = this.solver.read();
    solver.h.set(h);
    solver.v.set(v);
    solver.touch();
    solver.hold(this.load);
    this.solver.free();
    this.solver = solver;
  }

  restart() {
    const {h, v} = this.law.start;
    this.restore({h, v, load: {texels: [], forces: []}});
  }

  get state() {
    const {h, v} = this.solver.read();
    const {texels, forces} = this.load;
    return {h: h.slice(0, this.law.count), v: v.slice(0, this.law.count), load: {texels, forces}};
  }

  restore({h, v, load}) {
    this.solver.read();
    this.solver.h.set(h);
    this.solver.v.set(v);
    this.solver.touch();
    this.still = false;
    this.hold(load.texels, load.forces);
    this.settle();
  }

  // Heights of the part's points [m].
  pointHeights() {
    return this.heights.at(this.solver.read().h);
  }

  // Forces [N], outwards, from now on.
  hold(texels, forces) {
    this.load = {texels, forces, acceleration: counterpart(this.law, texels, forces)};
    this.solver.hold(this.load);
    if (texels.length) this.still = false;
  }

  // Velocities [m/s] added now.
  kick(texels, velocities) {
    const {law} = this;
    const {h, v} = this.solver.read();
    const everywhere = counterpart(
      law,
      texels,
      texels.map((texel, k) => law.mass[texel] * velocities[k]),
    );
    texels.forEach((texel, k) => {
      v[texel] += velocities[k];
    });
    if (everywhere.some(Boolean))
      for (let i = 0; i < law.count; i++) v[i] += law.response[i] * everywhere[law.part[i]];
    this.solver.touch();
    this.still = false;
  }

  // An impulse [N s], inwards, spread over texels by weights whose sum is 1.
  press({texels, weights}, impulse) {
    this.kick(
      texels,
      texels.map((texel, k) => (-impulse * weights[k] * this.law.share[texel]) / this.law.mass[texel]),
    );
  }

  // Recorded substeps, more of them where the sliders ask for it.
  step(substeps, dt) {
    if (this.still) return;
    const finer = Math.max(1, Math.ceil(dt / longestStep(this.law, this.sliders) - 1e-6));
    const {coefficients, balance} = this.coefficientsFor(dt / finer);
    this.solver.advance(substeps * finer, dt / finer, coefficients, this.sliders, balance);
  }

  coefficientsFor(dt) {
    const key = [dt, ...Object.values(this.sliders)].join(" ");
    if (!this.coefficients.has(key)) {
      if (this.coefficients.size > 8) this.coefficients.clear();
      const {law, sliders} = this;
      const coefficients = coefficientsOf(law, sliders, dt);
      const balance = law.meta.balanced.some(kept => kept)
        ? new VolumeBalance(law, coefficients, sliders, dt)
        : null;
      this.coefficients.set(key, {coefficients, balance});
    }
    return this.coefficients.get(key);
  }

  // Rests until something acts on it, where nothing is to be seen of its waves any more.
  settle() {
    if (this.still || this.load.texels.length) return;
    const {h, v} = this.solver.read();
    const size = STILL * this.law.meta.size;
    const time = longestStep(this.law, PLAIN);
    for (let i = 0; i < this.law.count; i++)
      if (Math.abs(h[i]) > size || Math.abs(v[i]) * time > size) return;
    this.still = true;
  }
}

// Whether the pass or the loop is faster: each takes some substeps, and the pass is waited for.
const TRIED_SUBSTEPS = 12;
function fasterSolver(law, gl) {
  const time = solver => {
    const coefficients = coefficientsOf(law, PLAIN, longestStep(law, PLAIN) / 2);
    const run = substeps => {
      solver.advance(substeps, 1e-6, coefficients, PLAIN, null);
      solver.read();
    };
    run(2);
    const begin = performance.now();
    run(TRIED_SUBSTEPS);
    return performance.now() - begin;
  };
  const pass = new WavePass(law, gl);
  if (time(pass) < time(new WaveLoop(law))) return pass;
  pass.free();
  return null;
}
