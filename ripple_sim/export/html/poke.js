// Where the pointer touches a surface, and the texels that a poke presses.
const POKE_RADIUS = 0.04; // of a poke [sizes of the object]
const POKE_TEXELS = 2.5; // at least [texels]

// The first triangle of the targets on a ray: its target and the point in the frame of the target's
// geom, or null.
function touched(parts, placesOf, eye, way) {
  let nearest = null;
  for (const part of parts) {
    const m = placesOf(part);
    const off = add(eye, m.slice(12, 15), -1);
    const [origin, ray] = [off, way].map(vector =>
      [0, 4, 8].map(column => dot(m.slice(column, column + 3), vector)),
    );
    const depth = hitDepth(part, origin, ray);
    if (depth < (nearest ? nearest.depth : Infinity)) nearest = {part, depth, point: add(origin, ray, depth)};
  }
  return nearest;
}

// How far along a ray the nearest triangle of a part lies (Moeller and Trumbore 1997).
function hitDepth({index, data: [points]}, [ox, oy, oz], [rx, ry, rz]) {
  let nearest = Infinity;
  for (let t = 0; t < index.length; t += 3) {
    const a = 3 * index[t];
    const b = 3 * index[t + 1];
    const c = 3 * index[t + 2];
    const ux = points[b] - points[a];
    const uy = points[b + 1] - points[a + 1];
    const uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a];
    const vy = points[c + 1] - points[a + 1];
    const vz = points[c + 2] - points[a + 2];
    const px = ry * vz - rz * vy;
    const py = rz * vx - rx * vz;
    const pz = rx * vy - ry * vx;
    const area = ux * px + uy * py + uz * pz;
    if (Math.abs(area) < 1e-30) continue;
    const dx = ox - points[a];
    const dy = oy - points[a + 1];
    const dz = oz - points[a + 2];
    const s = (dx * px + dy * py + dz * pz) / area;
    if (s < 0 || s > 1) continue;
    const qx = dy * uz - dz * uy;
    const qy = dz * ux - dx * uz;
    const qz = dx * uy - dy * ux;
    const r = (rx * qx + ry * qy + rz * qz) / area;
    if (r < 0 || s + r > 1) continue;
    const depth = (vx * qx + vy * qy + vz * qz) / area;
    if (depth > 0 && depth < nearest) nearest = depth;
  }
  return nearest;
}

// The texels within a radius of a point that links join to its nearest texel, with weights as of
// the solver's footprints, (1 - (d / radius)^2)^3, whose sum is 1.
function pressedTexels(law, point) {
  const {positions, begins, others, count, meta} = law;
  const away = i =>
    Math.hypot(positions[3 * i] - point[0], positions[3 * i + 1] - point[1], positions[3 * i + 2] - point[2]);
  let center = 0;
  let least = Infinity;
  for (let i = 0; i < count; i++) {
    const d = away(i);
    if (d < least) {
      least = d;
      center = i;
    }
  }
  let spacing = 0;
  for (let k = begins[center]; k < begins[center + 1]; k++)
    if (others[k] < count) spacing = Math.max(spacing, away(others[k]) - least);
  const radius = Math.max(POKE_RADIUS * meta.size, POKE_TEXELS * spacing);
  const texels = [center];
  const known = new Set(texels);
  for (const texel of texels) {
    for (let k = begins[texel]; k < begins[texel + 1]; k++) {
      const other = others[k];
      if (other < count && !known.has(other) && away(other) < radius) {
        known.add(other);
        texels.push(other);
      }
    }
  }
  // of a texel's area, which its mass stands for
  const weights = texels.map(
    i => law.mass[i] * law.inverseDensity[i] * Math.max(1 - (away(i) / radius) ** 2, 1e-3) ** 3,
  );
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  return {texels, weights: weights.map(weight => weight / total)};
}
