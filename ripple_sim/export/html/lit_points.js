"use strict";
// A target of one colour where pixels are drawn by software: its points are lit as the texels of a table, four at a time, and
// its triangles take their colours there. Of a closed one only those points are lit whose triangles face the eye.
const COLUMNS = 256;

class LitPoints {
  constructor(gl, part) {
    this.gl = gl; this.part = part;
    const rows = Math.ceil(part.source.length / COLUMNS);
    [this.places, this.normals] = [0, 1].map(() => tableOf(gl, "RGBA32F", COLUMNS, rows));
    this.colors = tableOf(gl, "RGBA8", COLUMNS, rows);
    this.target = framebufferOf(gl, "COLOR_ATTACHMENT0", this.colors);
    this.data = [0, 1].map(() => new Float32Array(4 * COLUMNS * rows));
    this.number = new Int32Array(part.source.length);  // of each point in the table
    this.triangles = new Uint32Array(part.index.length);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.triangles, gl.DYNAMIC_DRAW);
    gl.bindVertexArray(null);
  }

  // Lights the points that are seen from the eye, with a program that has its uniforms but for the tables.
  light(program, model, eye) {
    const gl = this.gl, points = this.select(model, eye), rows = Math.ceil(points / COLUMNS);
    [this.places, this.normals].forEach((table, i) => {
      gl.activeTexture(gl.TEXTURE3 + i);
      gl.bindTexture(gl.TEXTURE_2D, table);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, COLUMNS, rows, gl.RGBA, gl.FLOAT, this.data[i]);
    });
    gl.bindVertexArray(this.array);
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, this.triangles.subarray(0, this.count));
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, COLUMNS, rows);
    gl.useProgram(program.program);
    program.set({places: 3, normals: 4});
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  draw(program, modelProjection) {
    const gl = this.gl;
    [this.places, this.colors].forEach((table, i) => { gl.activeTexture(gl.TEXTURE3 + i); gl.bindTexture(gl.TEXTURE_2D, table); });
    gl.useProgram(program.program);
    program.set({modelProjection, places: 3, colors: 4});
    gl.bindVertexArray(this.array);
    gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_INT, 0);
  }

  // Puts the points into the table that triangles need which face the eye, all of an open target, and returns how many there are.
  select(model, eye) {
    const {part: {index, open, data: [points, normals, , heights]}, number, triangles, data: [places, ways]} = this;
    const off = add(eye, model.slice(12, 15), -1), [x, y, z] = [0, 4, 8].map(column => dot(model.slice(column, column + 3), off));
    let count = 0, found = 0;
    number.fill(-1);
    for (let t = 0; t < index.length; t += 3) {
      const a = 3 * index[t], b = 3 * index[t + 1], c = 3 * index[t + 2], px = points[a], py = points[a + 1], pz = points[a + 2];
      const ux = points[b] - px, uy = points[b + 1] - py, uz = points[b + 2] - pz, vx = points[c] - px, vy = points[c + 1] - py, vz = points[c + 2] - pz;
      if (!open && (uy * vz - uz * vy) * (x - px) + (uz * vx - ux * vz) * (y - py) + (ux * vy - uy * vx) * (z - pz) <= 0) continue;
      for (let k = t; k < t + 3; k++) {
        const i = index[k];
        if (number[i] < 0) {
          number[i] = found;
          for (let axis = 0; axis < 3; axis++) { places[4 * found + axis] = points[3 * i + axis]; ways[4 * found + axis] = normals[3 * i + axis]; }
          places[4 * found++ + 3] = heights[i];
        }
        triangles[count++] = number[i];
      }
    }
    this.count = count;
    return found;
  }
}
