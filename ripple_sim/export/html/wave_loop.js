// The waves of a surface by a loop over its texels: as fast as a graphics card that is emulated,
// and for every browser.

class WaveLoop {
  get kind() {
    return "loop";
  }

  constructor(law) {
    this.law = law;
    this.h = new Float32Array(law.count + 1); // the last entry: a fixed rim, always 0
    this.v = new Float32Array(law.count + 1);
    this.mixed = new Float32Array(law.count + 1);
    this.load = new Float32Array(law.count);
    this.acceleration = new Float64Array(law.parts);
  }

  read() {
    return this;
  }

  touch() {}

  free() {}

  // Forces [N] on some texels from now on, and an acceleration [m/s^2] of each part.
  hold({texels, forces, acceleration}) {
    this.load.fill(0);
    for (let k = 0; k < texels.length; k++) this.load[texels[k]] = forces[k];
    this.acceleration = acceleration;
  }

  // Substeps of dt [s] with coefficients for these sliders; see law.js.
  advance(substeps, dt, coefficients, {speed}, balance) {
    const {h, v} = this;
    const count = this.law.count;
    for (let i = 0; i < count; i++) h[i] += (dt / 2) * v[i];
    for (let step = 0; step < substeps; step++) {
      const acceleration = balance ? balance.added(this) : this.acceleration;
      this.kick(coefficients, speed ** 2, acceleration);
      const drift = step < substeps - 1 ? dt : dt / 2;
      for (let i = 0; i < count; i++) h[i] += drift * v[i];
    }
  }

  kick(coefficients, tension, acceleration) {
    const {
      law: {count, begins, others, elastic, viscous, ratio, part, parts},
      h,
      v,
      mixed,
      load,
    } = this;
    // viscosity in proportion to tension acts as tension does on h + share v
    const share = ratio / tension;
    const single = parts === 1;
    const pressure = acceleration[0];
    if (viscous) mixed.set(v);
    else for (let i = 0; i < count; i++) mixed[i] = h[i] + share * v[i];
    const field = viscous ? h : mixed;
    for (let i = 0, k = 0; i < count; i++) {
      const here = field[i];
      const end = begins[i + 1];
      let force = 0;
      for (; k < end; k++) force += elastic[k] * (field[others[k]] - here);
      force *= tension;
      if (viscous) for (let j = begins[i]; j < end; j++) force += viscous[j] * (mixed[others[j]] - mixed[i]);
      const c = 4 * i;
      const a = single ? pressure : acceleration[part[i]];
      v[i] =
        coefficients[c + 1] * v[i] +
        coefficients[c] * (force + load[i]) -
        coefficients[c + 2] * h[i] +
        coefficients[c + 3] * a;
    }
  }
}

// The pressure that keeps the volume where the density varies, by heights and velocities (`volume_rate` in
// solver/operator/volume.py): forces along links keep the momentum, which is then not the rate of the volume.
class VolumeBalance {
  constructor(law, coefficients, sliders, dt) {
    const {count, mass, inverseDensity, part, parts, response, stiffness} = law;
    const span = Float64Array.from({length: count}, (_, i) => {
      const half = (Math.max(law.damping[i] + sliders.damping, 0) * dt) / 2;
      return dt / (1 + Math.max(half, 2 * half - 1));
    });
    const inertia = new Float64Array(parts);
    const mean = values => values.reduce((sum, x) => sum + x, 0) / count;
    for (let i = 0; i < count; i++) inertia[part[i]] += mass[i] * inverseDensity[i] * span[i] * response[i];
    const meanSpan = mean(span);
    const meanDecay = mean(Float64Array.from({length: count}, (_, i) => coefficients[4 * i + 1]));
    // the forces of links by which heights and velocities that a pressure makes change the volume
    const moved = Float32Array.from(span, (time, i) => time * inverseDensity[i]);
    const links = new Float32Array(4 * count).map((_, i) => Number(i % 4 === 0));
    const [pulled, dragged] = ["h", "v"].map(name => {
      const loop = new WaveLoop(law);
      loop[name].set(moved);
      loop.kick(links, sliders.speed ** 2, loop.acceleration);
      return loop.v;
    });
    this.law = law;
    this.total = new Float64Array(parts);
    this.heights = new Float32Array(count);
    this.velocities = new Float32Array(count);
    for (let i = 0; i < count; i++) {
      const scale = law.meta.balanced[part[i]] && inertia[part[i]] > 0 ? -1 / inertia[part[i]] : 0;
      const weight = mass[i] * inverseDensity[i];
      this.heights[i] =
        scale * (pulled[i] - weight * stiffness[i] * sliders.stiffness * (span[i] - meanSpan));
      this.velocities[i] = scale * (weight * (coefficients[4 * i + 1] - meanDecay) + dragged[i]);
    }
  }

  // The acceleration of each part, with the acceleration by the load.
  added({h, v, acceleration}) {
    const {
      law: {count, part},
      total,
      heights,
      velocities,
    } = this;
    total.set(acceleration);
    for (let i = 0; i < count; i++) total[part[i]] += heights[i] * h[i] + velocities[i] * v[i];
    return total;
  }
}
