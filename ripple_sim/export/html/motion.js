// Surfaces whose own vertices move: a finer point takes the mean of the linear maps about the
// corners of its triangle (render/surfaces/moving.py).

class Motion {
  constructor(part, told, bytes) {
    const take = reader(bytes);
    this.points = told.points;
    this.step = told.step;
    this.V = take(Float32Array, 3 * told.points);
    this.F = take(Uint32Array, 3 * told.triangles);
    this.corners = take(Uint32Array, 3 * part.points);
    const shares = take(Uint16Array, 2 * part.points);
    const off = take(Int16Array, 3 * part.points);
    this.weights = Float32Array.from({length: 3 * part.points}, (_, i) => {
      const at = 2 * Math.floor(i / 3);
      const [a, b] = [shares[at], shares[at + 1]];
      return [a, b, 65535 - a - b][i % 3] / 65535;
    });
    this.off = Float32Array.from(off, value => (value / 32767) * told.far);
    this.directions = part.directions;
    this.parents = parentsOf(this);
  }

  // Points and directions of displacement for vertices V.
  at(V) {
    const {corners, weights, off, directions} = this;
    const maps = this.maps(V);
    const count = directions.length / 3;
    const rest = new Float32Array(3 * count);
    const turned = new Float32Array(3 * count);
    const m = new Float64Array(9);
    for (let i = 0; i < 3 * count; i += 3) {
      m.fill(0);
      let x = 0;
      let y = 0;
      let z = 0;
      for (let j = i; j < i + 3; j++) {
        const w = weights[j];
        const v = 3 * corners[j];
        for (let k = 0; k < 9; k++) m[k] += w * maps[3 * v + k];
        x += w * V[v];
        y += w * V[v + 1];
        z += w * V[v + 2];
      }
      const ox = off[i];
      const oy = off[i + 1];
      const oz = off[i + 2];
      const nx = directions[i];
      const ny = directions[i + 1];
      const nz = directions[i + 2];
      rest[i] = x + m[0] * ox + m[1] * oy + m[2] * oz;
      rest[i + 1] = y + m[3] * ox + m[4] * oy + m[5] * oz;
      rest[i + 2] = z + m[6] * ox + m[7] * oy + m[8] * oz;
      // a normal turns with the map's cofactors
      const a =
        (m[4] * m[8] - m[5] * m[7]) * nx +
        (m[5] * m[6] - m[3] * m[8]) * ny +
        (m[3] * m[7] - m[4] * m[6]) * nz;
      const b =
        (m[7] * m[2] - m[8] * m[1]) * nx +
        (m[8] * m[0] - m[6] * m[2]) * ny +
        (m[6] * m[1] - m[7] * m[0]) * nz;
      const c =
        (m[1] * m[5] - m[2] * m[4]) * nx +
        (m[2] * m[3] - m[0] * m[5]) * ny +
        (m[0] * m[4] - m[1] * m[3]) * nz;
      const size = Math.sqrt(a * a + b * b + c * c) || 1;
      turned[i] = a / size;
      turned[i + 1] = b / size;
      turned[i + 2] = c / size;
    }
    return {rest, directions: turned};
  }

  // Mean linear map about each vertex, row by row, of its triangles' maps by their areas.
  maps(V) {
    const {F, points} = this;
    const maps = new Float64Array(9 * points);
    const areas = new Float64Array(points);
    for (let t = 0; t < F.length; t += 3) {
      const old = sides(this.V, F, t);
      const now = sides(V, F, t);
      const area = Math.hypot(...old[2]);
      if (!(area > 0)) continue;
      const normal = scaled(old[2], 1 / area);
      const moved = unit(now[2]);
      // rows dual to the two sides and the normal
      const dual = [scaled(cross(old[1], normal), 1 / area), scaled(cross(normal, old[0]), 1 / area), normal];
      for (const v of F.subarray(t, t + 3)) {
        areas[v] += area;
        for (let a = 0; a < 3; a++)
          for (let b = 0; b < 3; b++)
            maps[9 * v + 3 * a + b] +=
              area * (now[0][a] * dual[0][b] + now[1][a] * dual[1][b] + moved[a] * dual[2][b]);
      }
    }
    for (let i = 0; i < maps.length; i++) {
      const area = areas[Math.floor(i / 9)];
      maps[i] = area > 0 ? maps[i] / area : Number((i % 9) % 4 === 0);
    }
    return maps;
  }
}

// Two sides of a triangle, and their cross product.
function sides(V, F, t) {
  const [a, b, c] = [F[t], F[t + 1], F[t + 2]].map(v => Array.from(V.subarray(3 * v, 3 * v + 3)));
  const u = add(b, a, -1);
  const w = add(c, a, -1);
  return [u, w, cross(u, w)];
}
