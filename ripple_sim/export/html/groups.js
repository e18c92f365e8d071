// Solid parts that look the same but for their colours, as one mesh in the world, which is drawn at once.
const SAME_LOOK = ["roughness", "metallic", "sheen", "coat", "translucency", "transparency", "emission"];
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// Parts that are drawn for themselves, and groups of the others.
function grouped(gl, parts) {
  const groups = new Map();
  const alone = part => part.target || part.uv || part.opacity < 1 || part.transparency > 0;
  for (const part of parts) {
    const key = alone(part) ? part : SAME_LOOK.map(name => part[name]).join(" ");
    groups.set(key, [...(groups.get(key) || []), part]);
  }
  return Array.from(groups.values(), group => (group.length > 1 ? new Group(gl, group) : group[0]));
}

class Group {
  constructor(gl, parts) {
    Object.assign(this, {gl, parts, open: false, opacity: 1, texture: -1});
    for (const name of SAME_LOOK) this[name] = parts[0][name];
    const counts = parts.map(part => part.source.length);
    const total = counts.reduce((sum, count) => sum + count, 0);
    this.firsts = counts.map((_, i) => counts.slice(0, i).reduce((sum, count) => sum + count, 0));
    const rest = Float32Array.from(parts.flatMap(part => Array.from(part.data[0])));
    this.data = [rest, new Float32Array(3 * total)];
    this.index = new Uint32Array(parts.reduce((sum, part) => sum + part.index.length, 0));
    const coarse = Uint32Array.from(
      parts.flatMap((part, i) => Array.from(part.shadow.index, vertex => vertex + this.firsts[i])),
    );
    const colors = Float32Array.from(parts.flatMap((part, i) => Array(counts[i]).fill(part.color).flat()));
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.buffers = [...this.data, colors].map((data, i) =>
      vertexBuffer(gl, i < 2 ? i : COLOR, 3, data, i < 2),
    );
    this.all = indexBuffer(gl, this.index, true);
    this.shadow = {...indexBuffer(gl, coarse), reaches: reachesOf(rest, coarse)};
  }

  // Puts its points where the bodies are, and lists the triangles that face the eye.
  place(bodies, eye) {
    const gl = this.gl;
    const [points, normals] = this.data;
    const {index} = this;
    let count = 0;
    this.parts.forEach((part, i) => {
      const m = times(bodies[part.body], part.local);
      const [rest, ways] = part.data;
      const first = this.firsts[i];
      for (let k = 0, j = 3 * first; k < rest.length; k += 3, j += 3) {
        for (let axis = 0; axis < 3; axis++) {
          points[j + axis] =
            m[axis] * rest[k] + m[4 + axis] * rest[k + 1] + m[8 + axis] * rest[k + 2] + m[12 + axis];
          normals[j + axis] = m[axis] * ways[k] + m[4 + axis] * ways[k + 1] + m[8 + axis] * ways[k + 2];
        }
      }
      count = facing(part.index, points, first, eye, index, count);
    });
    this.all.count = count;
    gl.bindVertexArray(this.array);
    this.data.forEach((data, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[i]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.all.buffer);
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, index.subarray(0, count));
  }
}
