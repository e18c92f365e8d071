// A target of one colour where pixels are drawn by software: its points are lit as the texels of a
// table, four at a time, and its triangles take their colours there. Of a closed one only those
// points are lit whose triangles face the eye.
const COLUMNS = 256;

class LitPoints {
  constructor(gl, part) {
    Object.assign(this, {gl, part, open: part.open});
    const rows = Math.ceil(part.source.length / COLUMNS);
    [this.places, this.normals] = [0, 1].map(() => tableOf(gl, "RGBA32F", COLUMNS, rows));
    this.colors = tableOf(gl, "RGBA8", COLUMNS, rows);
    this.target = framebufferOf(gl, {COLOR_ATTACHMENT0: this.colors});
    this.data = [0, 1].map(() => new Float32Array(4 * COLUMNS * rows));
    this.number = new Int32Array(part.source.length); // of each point in the table
    this.triangles = new Uint32Array(part.index.length);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.points = vertexBuffer(gl, 0, 4, this.data[0], true);
    this.all = indexBuffer(gl, this.triangles, true);
  }

  // Takes the points that are seen from the eye into the tables.
  place(model, eye) {
    const gl = this.gl;
    this.rows = Math.ceil(this.select(model, eye) / COLUMNS);
    [this.places, this.normals].forEach((table, i) => {
      gl.bindTexture(gl.TEXTURE_2D, table);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, COLUMNS, this.rows, gl.RGBA, gl.FLOAT, this.data[i]);
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.data[0], 0, 4 * COLUMNS * this.rows);
    gl.bindVertexArray(this.array);
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, this.triangles.subarray(0, this.all.count));
  }

  // Puts the points into the table that triangles need which face the eye, all of an open target,
  // and returns how many there are.
  select(model, eye) {
    const {
      part: {
        index,
        open,
        data: [points, normals, , heights],
      },
      number,
      triangles,
      data: [places, ways],
    } = this;
    const off = add(eye, model.slice(12, 15), -1);
    const [x, y, z] = [0, 4, 8].map(column => dot(model.slice(column, column + 3), off));
    if (open) triangles.set(index);
    const count = open ? index.length : facing(index, points, 0, [x, y, z], triangles, 0);
    let found = 0;
    number.fill(-1);
    for (let k = 0; k < count; k++) {
      const i = triangles[k];
      if (number[i] < 0) {
        number[i] = found;
        for (let axis = 0; axis < 3; axis++) {
          places[4 * found + axis] = points[3 * i + axis];
          ways[4 * found + axis] = normals[3 * i + axis];
        }
        places[4 * found++ + 3] = heights[i];
      }
      triangles[k] = number[i];
    }
    this.all.count = count;
    return found;
  }
}
