// Meshes as buffers: a drawn vertex for each point, or for each point and place in the texture.
const FEWEST_CELLS = 60; // of a mesh that has fewer triangles in shadows

// With fewer triangles for shadows: their points are at least about `cell` apart [m].
function partOf(gl, part, cell) {
  const {index, source, uv} = verticesOf(part);
  const count = source.length;
  const array = gl.createVertexArray();
  const data = [
    new Float32Array(3 * count),
    new Float32Array(3 * count),
    uv || new Float32Array(2 * count),
    new Float32Array(count),
  ];
  source.forEach((point, i) => {
    for (let k = 0; k < 3; k++) {
      data[0][3 * i + k] = part.rest[3 * point + k];
      data[1][3 * i + k] = part.directions[3 * point + k];
    }
  });
  gl.bindVertexArray(array);
  const buffers = [3, 3, 2, 1].map((size, i) => vertexBuffer(gl, i, size, data[i], part.target && i !== 2));
  const casting = part.casting === undefined ? index : index.subarray(0, 3 * part.casting);
  const coarse = clustered(data[0], casting, cell);
  const all = indexBuffer(gl, index);
  const shadow = {...indexBuffer(gl, coarse), index: coarse, reaches: reachesOf(data[0], coarse)};
  return Object.assign(part, {
    array,
    buffers,
    data,
    source,
    index,
    all,
    shadow,
    local: placed(part.position, part.quaternion),
  });
}

// Attributes of the vertices that are bound, `size` numbers each, and their triangles' indices;
// `moves` if they will change.
function vertexBuffer(gl, attribute, size, data, moves) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, moves ? gl.DYNAMIC_DRAW : gl.STATIC_DRAW);
  gl.enableVertexAttribArray(attribute);
  gl.vertexAttribPointer(attribute, size, gl.FLOAT, false, 0, 0);
  return buffer;
}

function indexBuffer(gl, index, moves = false) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, moves ? gl.DYNAMIC_DRAW : gl.STATIC_DRAW);
  return {buffer, count: index.length};
}

// Indices of the triangles' corners, the point of each vertex, and texture coordinates if there are any.
function verticesOf({F, points, uv}) {
  if (!uv)
    return {index: Uint32Array.from(F), source: Uint32Array.from({length: points}, (_, i) => i), uv: null};
  const known = new Map();
  const source = [];
  const places = [];
  const index = Uint32Array.from(F, (point, corner) => {
    const key = `${point} ${uv[2 * corner]} ${uv[2 * corner + 1]}`;
    if (!known.has(key)) {
      known.set(key, source.length);
      source.push(point);
      places.push(uv[2 * corner], 1 - uv[2 * corner + 1]);
    }
    return known.get(key);
  });
  return {index, source: Uint32Array.from(source), uv: Float32Array.from(places)};
}

// Triangles between one point in each cell of a grid, the farthest from the middle, so that edges
// stay; all for a mesh of few cells.
function clustered(points, index, cell) {
  const count = points.length / 3;
  const middle = [0, 1, 2].map(k => points.reduce((sum, x, i) => (i % 3 === k ? sum + x : sum), 0) / count);
  const chosen = new Map();
  const far = i => Math.hypot(...middle.map((x, k) => points[3 * i + k] - x));
  const keys = Array.from({length: count}, (_, i) =>
    [0, 1, 2].map(k => Math.floor(points[3 * i + k] / cell)).join(" "),
  );
  keys.forEach((key, i) => {
    if (!chosen.has(key) || far(i) > far(chosen.get(key))) chosen.set(key, i);
  });
  if (chosen.size < FEWEST_CELLS) return index;
  const places = keys.map(key => chosen.get(key));
  const known = new Set();
  const kept = [];
  for (let t = 0; t < index.length; t += 3) {
    const [a, b, c] = [places[index[t]], places[index[t + 1]], places[index[t + 2]]];
    if (a === b || b === c || c === a) continue;
    const key = a < b && a < c ? `${a} ${b} ${c}` : b < c ? `${b} ${c} ${a}` : `${c} ${a} ${b}`;
    if (!known.has(key)) {
      known.add(key);
      kept.push(a, b, c);
    }
  }
  return Uint32Array.from(kept);
}

// How far the triangles at a point reach that are closer to it than to their other corners [m], by
// the points.
function reachesOf(points, index) {
  const reaches = new Map();
  for (let i = 0; i < index.length; i++) {
    const a = index[i];
    const b = index[i % 3 < 2 ? i + 1 : i - 2];
    const side = Math.hypot(
      points[3 * a] - points[3 * b],
      points[3 * a + 1] - points[3 * b + 1],
      points[3 * a + 2] - points[3 * b + 2],
    );
    for (const point of [a, b]) reaches.set(point, Math.max(reaches.get(point) || 0, 0.6 * side));
  }
  return {points: Uint32Array.from(reaches.keys()), far: Float32Array.from(reaches.values())};
}

// Displaces a target from its rest by heights [m] of its points; `limit` is the height of the
// strongest colours; the normal of a point follows the triangles round it; creases stay.
function displace(part, {rest, directions}, heights, limit) {
  const {F, source, data} = part;
  const count = part.points;
  const points = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; i++)
    for (let k = 0; k < 3; k++) points[3 * i + k] = rest[3 * i + k] + heights[i] * directions[3 * i + k];
  for (let t = 0; t < F.length; t += 3) {
    const a = 3 * F[t];
    const b = 3 * F[t + 1];
    const c = 3 * F[t + 2];
    const ux = points[b] - points[a];
    const uy = points[b + 1] - points[a + 1];
    const uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a];
    const vy = points[c + 1] - points[a + 1];
    const vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    for (const p of [a, b, c]) {
      normals[p] += x;
      normals[p + 1] += y;
      normals[p + 2] += z;
    }
  }
  for (let i = 0; i < source.length; i++) {
    const p = 3 * source[i];
    const size = Math.sqrt(normals[p] ** 2 + normals[p + 1] ** 2 + normals[p + 2] ** 2) || 1;
    for (let k = 0; k < 3; k++) {
      data[0][3 * i + k] = points[p + k];
      data[1][3 * i + k] = normals[p + k] / size;
    }
    data[3][i] = heights[source[i]] / limit;
  }
}

// Appends triangles that face the eye to a list, their vertices counted from `first`, and returns
// how long it is then.
function facing(triangles, points, first, [x, y, z], list, count) {
  for (let t = 0; t < triangles.length; t += 3) {
    const i = triangles[t] + first;
    const j = triangles[t + 1] + first;
    const k = triangles[t + 2] + first;
    const a = 3 * i;
    const b = 3 * j;
    const c = 3 * k;
    const px = points[a];
    const py = points[a + 1];
    const pz = points[a + 2];
    const ux = points[b] - px;
    const uy = points[b + 1] - py;
    const uz = points[b + 2] - pz;
    const vx = points[c] - px;
    const vy = points[c + 1] - py;
    const vz = points[c + 2] - pz;
    if ((uy * vz - uz * vy) * (x - px) + (uz * vx - ux * vz) * (y - py) + (ux * vy - uy * vx) * (z - pz) <= 0)
      continue;
    list[count++] = i;
    list[count++] = j;
    list[count++] = k;
  }
  return count;
}
