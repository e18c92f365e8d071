// Vectors, and matrices of 16 numbers, column by column.
const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map(x => s * x);
const unit = a => scaled(a, 1 / Math.max(Math.hypot(...a), 1e-12));
const times = (a, b) => Array.from(new DOMMatrix(a).multiply(new DOMMatrix(b)).toFloat64Array());

function placed(position, [w, x, y, z]) {
  return [
    1 - 2 * (y * y + z * z),
    2 * (x * y + w * z),
    2 * (x * z - w * y),
    0,
    2 * (x * y - w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z + w * x),
    0,
    2 * (x * z + w * y),
    2 * (y * z - w * x),
    1 - 2 * (x * x + y * y),
    0,
    ...position,
    1,
  ];
}

// World to eye coordinates of a camera: its axes are the columns right, up and backwards.
function viewOf(position, right, up, back) {
  return [
    right[0],
    up[0],
    back[0],
    0,
    right[1],
    up[1],
    back[1],
    0,
    right[2],
    up[2],
    back[2],
    0,
    -dot(right, position),
    -dot(up, position),
    -dot(back, position),
    1,
  ];
}

function perspective(fovy, aspect, near, far) {
  const s = 1 / Math.tan((fovy * Math.PI) / 360);
  return [
    s / aspect,
    0,
    0,
    0,
    0,
    s,
    0,
    0,
    0,
    0,
    (near + far) / (near - far),
    -1,
    0,
    0,
    (2 * near * far) / (near - far),
    0,
  ];
}

function orthographic(half, depth) {
  return [1 / half, 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, -1 / depth, 0, 0, 0, 0, 1];
}
