// The law of a surface's waves, as the solver has it (solver/operator/step.py). At every texel
// there is a height h [m] along the normal and its rate v [m/s]. Links join a texel i with its
// neighbours j. A substep of dt is
//
//   force_i = sum over links of weight_ij (h_j - h_i) + viscous_ij (v_j - v_i) + load_i      [N]
//   v_i    <- decay_i v_i + gain_i force_i - spring_i h_i + push_i acceleration              "kick"
//   h_i    <- h_i + dt v_i                                                                   "drift"
//
// with half = zeta dt / 2, decay = (1 - half) / (1 + half) but at least 0, span = dt / (1 +
// max(half, 2 half - 1)), gain = span / mass (0 where the surface is clamped), spring = span k, and
// push = span times the texel's response. The acceleration is a uniform pressure on each part of
// the surface that keeps its volume. Drifts are halved at both ends of a step (leapfrog,
// drift-kick-drift). Plates have links as far as their bending reaches.

// The law from its description and its bytes (wave_law.py).
function lawOf(meta, bytes) {
  const take = reader(bytes);
  const count = meta.charts * meta.resolution ** 2;
  const law = {meta, count, ratio: meta.viscosityRatio, parts: meta.kept.length};
  const sets = meta.links.map(set => takeLinks(take, set, count));
  Object.assign(law, joined(sets, count));
  const field = name => takeField(take, meta[name], count);
  for (const name of ["mass", "damping", "stiffness", "moving", "share", "inverseDensity"])
    law[name] = field(name);
  law.part = meta.parted ? Int32Array.from(take.planes(Uint16Array, count)) : new Int32Array(count);
  law.positions = takePlaces(take, meta, count);
  takeSamples(take, law);
  law.radius = meta.limited ? field("radius") : null;
  law.start = {h: field("height"), v: field("velocity")};
  law.response = law.share.map((share, i) => share * law.inverseDensity[i]);
  law.least = new Float64Array(law.parts);
  for (let i = 0; i < count; i++)
    if (law.share[i] > 0) law.least[law.part[i]] += law.mass[i] * law.inverseDensity[i] * law.response[i];
  return law;
}

// One number everywhere, or half-precision numbers times a scale.
function takeField(take, coded, count) {
  if (typeof coded === "number") return new Float32Array(count).fill(coded);
  return Float32Array.from(take.planes(Uint16Array, count), half => coded.scale * ofHalf(half));
}

// A number of 16 bits: sign, five bits of the exponent, ten of the fraction.
function ofHalf(half) {
  const exponent = (half >> 10) & 31;
  const fraction = half & 1023;
  const sign = half & 32768 ? -1 : 1;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 25) * (1024 + fraction) : 2 ** -24 * fraction);
}

// Links of a kind, each once: its two texels and its weight.
function takeLinks(take, {kind, count: links, weights}, texels) {
  const counts = take.planes(Uint16Array, texels);
  const offsets = take.planes(Uint32Array, links);
  const values = weights === "exact" ? take.planes(Float32Array, links) : takeField(take, weights, links);
  const first = new Uint32Array(links);
  const second = new Uint32Array(links);
  for (let texel = 0, link = 0; texel < texels; texel++) {
    for (let i = 0; i < counts[texel]; i++, link++) {
      first[link] = texel;
      second[link] = texel + offsets[link];
    }
  }
  return {kind, first, second, values};
}

// The links of every texel, from `begins[i]` to `begins[i + 1]`: their other ends, elastic weights,
// and viscous ones where these are not in proportion. The texel `count` stands for a fixed rim and
// has no links.
function joined(sets, count) {
  const begins = new Uint32Array(count + 1);
  const inside = texel => texel < count;
  for (const {first, second} of sets)
    for (const ends of [first, second]) for (const texel of ends) if (inside(texel)) begins[texel + 1]++;
  for (let i = 0; i < count; i++) begins[i + 1] += begins[i];
  const at = begins.slice(0, count);
  const others = new Uint32Array(begins[count]);
  const elastic = new Float32Array(begins[count]);
  const viscous = sets.some(({kind}) => kind === "viscous") ? new Float32Array(begins[count]) : null;
  for (const {kind, first, second, values} of sets) {
    const weights = kind === "viscous" ? viscous : elastic;
    values.forEach((value, link) => {
      for (const [end, other] of [
        [first[link], second[link]],
        [second[link], first[link]],
      ]) {
        if (!inside(end)) continue;
        others[at[end]] = other;
        weights[at[end]++] = value;
      }
    });
  }
  return {begins, others, elastic, viscous};
}

// Places of the texels [m], three numbers each, from differences in 16 bits.
function takePlaces(take, {low, size}, count) {
  const steps = take.planes(Uint16Array, 3 * count);
  const places = new Float32Array(3 * count);
  const sum = [0, 0, 0];
  for (let i = 0; i < 3 * count; i++) {
    sum[i % 3] = (sum[i % 3] + steps[i]) & 65535;
    places[i] = low[i % 3] + (sum[i % 3] / 65535) * size;
  }
  return places;
}

// What the user's sliders multiply or add: speed [1], stiffness [1], damping [1/s].
const PLAIN = {speed: 1, stiffness: 1, damping: 0};

// Longest substep [s] with the sliders where they are; see WaveOperator.stable_timestep and longest_timestep.
const SAFETY = 0.99;
const SPRING_PHASE = 0.33;
function longestStep({meta: {rates}}, {speed, stiffness}) {
  const wave = speed ** 2 * rates.links + stiffness * rates.springs;
  const stable = (4 * SAFETY) / (rates.viscous + Math.sqrt(rates.viscous ** 2 + 4 * wave));
  return rates.spring > 0 ? Math.min(stable, SPRING_PHASE / Math.sqrt(stiffness * rates.spring)) : stable;
}

// The kick's coefficients for substeps of dt [s], four numbers a texel: gain, decay, spring, push.
function coefficientsOf(law, sliders, dt) {
  const {count, mass, damping, stiffness, moving, response} = law;
  const coefficients = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) {
    const half = (Math.max(damping[i] + sliders.damping, 0) * dt) / 2;
    const span = dt / (1 + Math.max(half, 2 * half - 1));
    coefficients[4 * i] = moving[i] ? span / mass[i] : 0;
    coefficients[4 * i + 1] = Math.max((1 - half) / (1 + half), 0);
    coefficients[4 * i + 2] = span * stiffness[i] * sliders.stiffness;
    coefficients[4 * i + 3] = span * response[i];
  }
  return coefficients;
}

// What balances momenta, or forces, on some texels in each part that keeps its volume
// (solver/operator/volume.py).
function counterpart(law, texels, momenta) {
  const sums = new Float64Array(law.parts);
  for (let k = 0; k < texels.length; k++)
    sums[law.part[texels[k]]] += law.inverseDensity[texels[k]] * momenta[k];
  return sums.map((sum, part) => (law.meta.kept[part] && law.least[part] > 0 ? -sum / law.least[part] : 0));
}
