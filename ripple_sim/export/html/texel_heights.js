// From the heights of the texels to those of a part's points, as the renderer has them (MovingMesh,
// HeightMap): heights that are too large for the object are bent, each chart is surrounded by the
// texels beyond its sides, and a quadratic B-spline goes between.

// The texels about each chart, and where the points take their heights (wave_law.py).
function takeSamples(take, law) {
  const {charts, resolution, points} = law.meta;
  const width = resolution + 2;
  const border = 4 * width - 4;
  const sources = take.planes(Int32Array, charts * border);
  const around = new Int32Array(charts * width * width);
  for (let place = 0, next = 0, texel = 0; place < around.length; place++) {
    const row = Math.floor(place / width) % width;
    const column = place % width;
    const outside = row === 0 || column === 0 || row === width - 1 || column === width - 1;
    around[place] = outside ? sources[next++] : texel++;
  }
  const first = take.planes(Uint32Array, points);
  const offsets = take.planes(Int16Array, 2 * points);
  law.samples = {width, around, first, offsets: Float32Array.from(offsets, offset => offset / 32767)};
}

class TexelHeights {
  constructor(law) {
    this.law = law;
    this.around = new Float32Array(law.samples.around.length);
    this.points = new Float32Array(law.samples.first.length);
  }

  // Heights of the points [m] for heights of the texels.
  at(h) {
    this.surround(h);
    const {
      around,
      points,
      law: {
        samples: {width, first, offsets},
      },
    } = this;
    for (let i = 0; i < points.length; i++) {
      const s = offsets[2 * i];
      const t = offsets[2 * i + 1];
      const a = 0.5 * (0.5 - t) * (0.5 - t);
      const b = 0.75 - t * t;
      const c = 0.5 * (0.5 + t) * (0.5 + t);
      const row = place => a * around[place] + b * around[place + 1] + c * around[place + 2];
      const place = first[i];
      points[i] =
        0.5 * (0.5 - s) * (0.5 - s) * row(place) +
        (0.75 - s * s) * row(place + width) +
        0.5 * (0.5 + s) * (0.5 + s) * row(place + 2 * width);
    }
    return points;
  }

  // Beyond a fixed rim there are mirror images (numbers below -1); corners without a texel have the
  // mean of the three places beside them, and in a fixed rim all four have a mean of 0.
  surround(h) {
    const {
      around,
      law: {meta, samples},
    } = this;
    const {around: sources} = samples;
    for (let place = 0; place < sources.length; place++) {
      const source = sources[place];
      if (source !== -1) around[place] = source >= 0 ? this.bent(h, source) : -this.bent(h, -2 - source);
    }
    for (const [corner, a, b, c] of meta.means) around[corner] = (around[a] + around[b] + around[c]) / 3;
    for (const [corner, a, b, c] of meta.ends) around[corner] = -(around[a] + around[b] + around[c]);
  }

  // DisplacementLimit of solver/waves/height_map.py.
  bent(h, texel) {
    const {
      radius,
      meta: {free, most},
    } = this.law;
    const height = h[texel];
    if (!radius) return height;
    const beyond = Math.abs(height) / radius[texel] - free;
    if (beyond <= 0) return height;
    return Math.sign(height) * radius[texel] * (free + (most - free) * Math.tanh(beyond / (most - free)));
  }
}
