// Vectors, and matrices of 16 numbers, column by column.
const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map(x => s * x);
const unit = a => scaled(a, 1 / Math.max(Math.hypot(...a), 1e-12));
const times = (a, b) => Array.from(new DOMMatrix(a).multiply(new DOMMatrix(b)).toFloat64Array());

// The matrix of a position and a quaternion.
function placed(position, [w, x, y, z]) {
  const right = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)];
  const forward = [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)];
  const up = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  return [...right, 0, ...forward, 0, ...up, 0, ...position, 1];
}

// World to eye coordinates of a camera: its axes are the columns right, up and backwards.
function viewOf(position, right, up, back) {
  const rows = [0, 1, 2].flatMap(k => [right[k], up[k], back[k], 0]);
  return [...rows, ...[right, up, back].map(axis => -dot(axis, position)), 1];
}

function perspective(fovy, aspect, near, far) {
  const s = 1 / Math.tan((fovy * Math.PI) / 360);
  const scale = (near + far) / (near - far);
  const offset = (2 * near * far) / (near - far);
  return [s / aspect, 0, 0, 0, 0, s, 0, 0, 0, 0, scale, -1, 0, 0, offset, 0];
}

function orthographic(half, depth) {
  return [1 / half, 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, -1 / depth, 0, 0, 0, 0, 1];
}
