// The texels' grid as lines over a surface whose waves the page solves.
const GRID_LIFT = 2e-3; // of the lines off the surface [sizes of the object]
const GRID_VERTEX = shaderOf("grid.vert");
const GRID_FRAGMENT = shaderOf("grid.frag");

class TexelGrid {
  constructor(gl, law) {
    Object.assign(this, {gl, law, program: programOf(gl, GRID_VERTEX, GRID_FRAGMENT)});
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    const {lines, normals} = gridOf(law);
    vertexBuffer(gl, 0, 3, law.positions, false);
    vertexBuffer(gl, 1, 3, normals, false);
    this.heights = vertexBuffer(gl, 2, 1, new Float32Array(law.count), true);
    this.lines = indexBuffer(gl, lines);
  }

  draw(modelProjection, h) {
    const gl = this.gl;
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.useProgram(this.program.program);
    this.program.set({modelProjection, lift: GRID_LIFT * this.law.meta.size});
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.heights);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, h, 0, this.law.count);
    gl.drawElements(gl.LINES, this.lines.count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.BLEND);
  }
}

// Pairs of neighbours in a row or a column, and the normals of the texels.
function gridOf({count, positions, samples: {width, around}}) {
  const lines = [];
  const normals = new Float32Array(3 * count);
  const at = texel => Array.from(positions.subarray(3 * texel, 3 * texel + 3));
  for (let place = 0; place < around.length; place++) {
    const row = Math.floor(place / width) % width;
    const column = place % width;
    if (row === 0 || column === 0 || row === width - 1 || column === width - 1) continue;
    const texel = around[place];
    const [east, west, north, south] = [1, -1, width, -width].map(step => around[place + step]);
    for (const other of [east, north]) if (other >= 0 && other !== texel) lines.push(texel, other);
    const beside = other => (other >= 0 ? at(other) : at(texel));
    normals.set(
      unit(cross(add(beside(east), beside(west), -1), add(beside(north), beside(south), -1))),
      3 * texel,
    );
  }
  return {lines: Uint32Array.from(lines), normals};
}
