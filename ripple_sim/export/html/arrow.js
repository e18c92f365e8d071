// The arrow of a contact: a shaft and a tip round the z axis, whose point is the origin.
const ARROW_SIDES = 10;
// Rings of points: radius and z, and the normal's radial and axial parts. The shaft's end, the shaft
// and the tip's foot, the tip, and the middle of the shaft's end.
const ARROW_RINGS = [
  {place: [0.03, -1], normal: [1, 0]},
  {place: [0.03, -0.25], normal: [1, 0]},
  {place: [0.09, -0.25], normal: [1, 0.4]},
  {place: [0, 0], normal: [1, 0.4]},
  {place: [0, -1], normal: [0, -1]},
];
// Triangles between a side and the next one: each corner is a ring and 0 or 1 for the side.
const ARROW_TRIANGLES = [
  [[0, 0], [0, 1], [1, 0]],
  [[0, 1], [1, 1], [1, 0]],
  [[2, 0], [2, 1], [3, 0]],
  [[1, 0], [1, 1], [2, 1]],
  [[1, 0], [2, 1], [2, 0]],
  [[0, 0], [4, 0], [0, 1]],
];

function arrowPart() {
  const points = [];
  const normals = [];
  const F = [];
  const corner = (side, [ring, next]) => ARROW_RINGS.length * ((side + next) % ARROW_SIDES) + ring;
  for (let side = 0; side < ARROW_SIDES; side++) {
    const angle = (2 * Math.PI * side) / ARROW_SIDES;
    const x = Math.cos(angle);
    const y = Math.sin(angle);
    for (const {place, normal} of ARROW_RINGS) {
      points.push(x * place[0], y * place[0], place[1]);
      normals.push(x * normal[0], y * normal[0], normal[1]);
    }
    for (const triangle of ARROW_TRIANGLES) F.push(...triangle.map(place => corner(side, place)));
  }
  return {
    rest: points,
    directions: normals,
    F,
    points: points.length / 3,
    uv: null,
    position: [0, 0, 0],
    quaternion: [1, 0, 0, 0],
    open: true,
    color: [0.85, 0.08, 0.05],
    roughness: 0.6,
    metallic: 0,
    sheen: 0,
    coat: 0,
    translucency: 0,
    transparency: 0,
    emission: 0.4,
    opacity: 1,
    texture: -1,
  };
}
