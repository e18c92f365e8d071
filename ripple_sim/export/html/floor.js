// The floor in cells, of which only those are drawn that the camera sees. Only cells that a shadow
// may reach look into the shadow map: where software draws, its samples take most of the time.
const INNER = 14; // cells from the middle of one size, up to the camera's distance
const OUTER = 8; // and from there to a side, which grow
const HALF = INNER + OUTER;
// by which shadows may be wider
const MARGIN = 3; // [texels of the shadow map]
const WIDER = 1.5; // [radii of their penumbras]
// of what casts shadows on the floor [distances of the camera]: balls wait far above to be thrown
const FARTHEST = 20;
const ROWS = 24; // of the picture, each of which the sky is drawn in or not

class Floor {
  constructor(gl, floor, shaders, plain) {
    Object.assign(this, {gl, floor, side: 2 * HALF, row: 2 * HALF + 1});
    // `bare`: from where to where the picture shows the sky; `ends`: whether the floor's rim may be seen
    this.programs = [[], ["SHADOW"]].map(more =>
      programOf(gl, ...shaders, [...(plain ? ["PLAIN"] : []), ...more]),
    );
    this.plane = new Float32Array(2 * this.row ** 2);
    this.outside = new Uint8Array(this.row ** 2);
    this.shadowed = new Uint8Array(this.side ** 2);
    this.triangles = new Uint16Array(6 * this.side ** 2);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.points = vertexBuffer(gl, 0, 2, this.plane, true);
    indexBuffer(gl, this.triangles, true);
  }

  // Makes its cells for a frame.
  set(view, frame, light, casters, reach) {
    const gl = this.gl;
    const axes = [frame.slice(0, 3), frame.slice(4, 7)];
    const off = add(view.focus, frame.slice(12, 15), -1);
    const middle = axes.map(axis => dot(off, axis));
    this.place(middle, view.distance, reach, times(view.matrix, frame));
    this.bare = this.leaves(view, frame);
    this.ends = this.bare !== null && this.floor.half.some((half, i) => half && half < Math.abs(middle[i]) + reach);
    this.shade(frame, light, casters, middle, view.distance, reach);
    this.list();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.plane);
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, this.triangles);
  }

  // Draws it with what `use` does to make a program the present one.
  draw(use) {
    for (const shadow of [0, 1])
      if (this.counts[shadow]) {
        use(this.programs[shadow]);
        this.drawCells(shadow);
      }
  }

  // Those in light, or those in shadow.
  drawCells(shadow) {
    const gl = this.gl;
    const count = this.counts[shadow];
    gl.bindVertexArray(this.array);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, shadow ? 2 * (this.triangles.length - count) : 0);
  }

  // Places of the cells' corners, and outside which sides of the picture each lies.
  place(middle, distance, reach, m) {
    const {plane, outside, row} = this;
    const half = this.floor.half.map(x => x || 1e9);
    const edges = middle.map((at, i) =>
      Array.from({length: row}, (_, k) => {
        const steps = Math.abs(k - HALF);
        const far = Math.max(steps - INNER, 0) / OUTER;
        const off =
          Math.sign(k - HALF) *
          ((Math.min(steps, INNER) / INNER) * distance + far * far * (reach - distance));
        return Math.max(-half[i], Math.min(half[i], at + off));
      }),
    );
    for (let i = 0, k = 0; i < row; i++)
      for (let j = 0; j < row; j++, k++) {
        const x = (plane[2 * k] = edges[0][j]);
        const y = (plane[2 * k + 1] = edges[1][i]);
        const u = m[0] * x + m[4] * y + m[12];
        const v = m[1] * x + m[5] * y + m[13];
        const w = m[3] * x + m[7] * y + m[15];
        outside[k] = (u < -w) | ((u > w) << 1) | ((v < -w) << 2) | ((v > w) << 3);
      }
  }

  // From where to where in the picture's height, from -1 to 1, it may leave something to the sky:
  // between rows whose ends lie on it, it covers everything.
  leaves(view, frame) {
    const {plane} = this;
    const [axis, other, up, origin] = [0, 4, 8, 12].map(k => frame.slice(k, k + 3));
    const off = add(view.eye, origin, -1);
    const inside = (x, i) => plane[i] <= x && x <= plane[plane.length - 2 + i];
    const covered = y =>
      [-1, 1].every(x => {
        const ray = add(add(view.ray[0], view.ray[1], x), view.ray[2], y);
        const depth = -dot(off, up) / dot(ray, up);
        const hit = add(off, ray, depth);
        return depth > 0.03 * view.distance && inside(dot(hit, axis), 0) && inside(dot(hit, other), 1);
      });
    const rows = Array.from({length: ROWS + 1}, (_, i) => (2 * i) / ROWS - 1);
    const ends = rows.map(covered);
    const open = rows
      .slice(1)
      .map((_, i) => i)
      .filter(i => !(ends[i] && ends[i + 1]));
    return open.length ? [rows[open[0]], rows[open[open.length - 1] + 1]] : null;
  }

  // Which cells the casters may darken: those about the points of their shadows, as wide as their triangles.
  shade(frame, light, casters, middle, distance, reach) {
    const {shadowed, side} = this;
    const up = frame.slice(8, 11);
    const way = light.lampWay[0];
    const rise = dot(way, up);
    const anywhere = light.lampShape[0][0] || rise < 0.05;
    shadowed.fill(light.casts && anywhere ? 1 : 0);
    if (!light.casts || anywhere) return;
    const cell = x => {
      const far = Math.abs(x) / distance;
      const steps =
        far < 1 ? INNER * far : INNER + OUTER * Math.sqrt(((far - 1) * distance) / (reach - distance));
      return Math.max(0, Math.min(side - 1, Math.floor(HALF + (x < 0 ? -steps : steps))));
    };
    // along the light on the floor's axes
    const rows = [
      ...[0, 4].map(i => add(frame.slice(i, i + 3), up, -dot(way, frame.slice(i, i + 3)) / rise)),
      up,
    ];
    for (const {
      part: {
        shadow: {
          reaches: {points, far},
        },
        data: [places],
      },
      model,
    } of casters) {
      const [[ax, bx, cx, dx], [ay, by, cy, dy], [az, bz, cz, dz]] = rows.map((row, i) => [
        ...[0, 4, 8].map(k => dot(row, model.slice(k, k + 3))),
        dot(row, add(model.slice(12, 15), frame.slice(12, 15), -1)) - (middle[i] || 0),
      ]);
      for (let k = 0; k < points.length; k++) {
        const point = points[k];
        const x = places[3 * point];
        const y = places[3 * point + 1];
        const z = places[3 * point + 2];
        const away = (az * x + bz * y + cz * z + dz) / rise;
        if (away > FARTHEST * distance) continue;
        const margin = (MARGIN * light.shadowTexel + far[k] + WIDER * light.lampSize * away) / rise;
        const u = ax * x + bx * y + cx * z + dx;
        const v = ay * x + by * y + cy * z + dy;
        const left = cell(u - margin);
        const right = cell(u + margin);
        for (let i = cell(v - margin), high = cell(v + margin); i <= high; i++)
          for (let j = left; j <= right; j++) shadowed[i * side + j] = 1;
      }
    }
  }

  // Lists the triangles of cells in light from the beginning, and of those in shadow up to the end.
  list() {
    const {outside, shadowed, triangles, side, row} = this;
    let first = 0;
    let last = triangles.length;
    for (let cell = 0; cell < side * side; cell++) {
      const k = cell + Math.floor(cell / side);
      if (outside[k] & outside[k + 1] & outside[k + row] & outside[k + row + 1]) continue;
      let at = shadowed[cell] ? (last -= 6) : (first += 6) - 6;
      triangles[at++] = k;
      triangles[at++] = k + 1;
      triangles[at++] = k + row;
      triangles[at++] = k + 1;
      triangles[at++] = k + row + 1;
      triangles[at++] = k + row;
    }
    this.counts = [first, triangles.length - last];
  }
}
