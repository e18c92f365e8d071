// Smooths edges where WebGL runs on the processor: samples for each pixel would cost more. Only
// the rectangles round the parts are smoothed, since floor and sky have no edges of their own.
const EDGE_MARGIN = 8; // round the points of a part that cast shadows [pixels]

class Smoothing {
  constructor(gl, canvas) {
    this.gl = gl;
    this.canvas = canvas;
    this.picture = tableOf(gl, "RGBA8", 1, 1, LINEAR, 0);
    this.program = programOf(gl, EVERYWHERE_VERTEX, shaderOf("smooth.frag"));
  }

  // Smooths the canvas about parts, or everywhere.
  draw(parts, viewProjection, everywhere) {
    const gl = this.gl;
    const {width, height} = this.canvas;
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    gl.copyTexImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 0, 0, width, height, 0);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.useProgram(this.program.program);
    this.program.set({image: 1});
    gl.enable(gl.SCISSOR_TEST);
    const rectangles = everywhere ? [[0, 0, width, height]] : this.rectangles(parts, viewProjection);
    for (const rectangle of rectangles) {
      gl.scissor(...rectangle);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.disable(gl.SCISSOR_TEST);
  }

  // Where parts are seen: left, bottom, width and height [pixels]; everything where that is less.
  rectangles(parts, viewProjection) {
    const {width, height} = this.canvas;
    const covered = [];
    for (const {part, model} of parts) {
      const [left, right, bottom, top] = seenRange(part, times(viewProjection, model));
      const x = Math.max(Math.floor((0.5 + 0.5 * left) * width) - EDGE_MARGIN, 0);
      const y = Math.max(Math.floor((0.5 + 0.5 * bottom) * height) - EDGE_MARGIN, 0);
      const wide = Math.min(Math.ceil((0.5 + 0.5 * right) * width) + EDGE_MARGIN, width) - x;
      const high = Math.min(Math.ceil((0.5 + 0.5 * top) * height) + EDGE_MARGIN, height) - y;
      if (wide > 0 && high > 0) covered.push([x, y, wide, high]);
    }
    const area = covered.reduce((sum, [, , wide, high]) => sum + wide * high, 0);
    return area < width * height ? covered : [[0, 0, width, height]];
  }
}

// Least and greatest x, and y, of a part on the screen, which reaches from -1 to 1; none of a part
// that lies beside the screen, and all of one that reaches behind the eye.
function seenRange({data: [places], shadow}, m) {
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  let outside = 31; // the sides of the picture, and the eye's plane, beyond which all points lie
  let behind = false;
  for (const point of shadow.reaches.points) {
    const x = places[3 * point];
    const y = places[3 * point + 1];
    const z = places[3 * point + 2];
    const u = m[0] * x + m[4] * y + m[8] * z + m[12];
    const v = m[1] * x + m[5] * y + m[9] * z + m[13];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    outside &= (u < -w) | ((u > w) << 1) | ((v < -w) << 2) | ((v > w) << 3) | ((w <= 0) << 4);
    if (w <= 0) {
      behind = true;
      continue;
    }
    left = Math.min(left, u / w);
    right = Math.max(right, u / w);
    bottom = Math.min(bottom, v / w);
    top = Math.max(top, v / w);
  }
  if (outside) return [Infinity, -Infinity, Infinity, -Infinity];
  return behind ? [-1, 1, -1, 1] : [left, right, bottom, top];
}
