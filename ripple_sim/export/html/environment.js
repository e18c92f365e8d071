// The light of the studio's soft boxes by direction, as maps, which turn with the camera about the
// vertical: what surfaces reflect of them, with the share of the sky against that of the floor, and
// their diffuse light (render/glsl/lights.glsl).
const COAT_ROUGHNESS = 0.06;

class Environment {
  // With how strong the boxes are, and how much of them lights diffuse surfaces.
  constructor(gl, boxes, strength, share) {
    Object.assign(this, {gl, strength, share, maps: new Map()});
    this.boxes = boxes.map(([azimuth, elevation, width, height, ...radiance]) => {
      const normal = upwards([1, 0, 0], [0, 1, 0], azimuth, elevation);
      const side = unit(cross([0, 0, 1], normal));
      return {normal, side, above: cross(normal, side), size: [width, height], radiance};
    });
  }

  // Of reflections by a roughness.
  mirrored(roughness) {
    return this.map(roughness, roughness < 0.15 ? 128 : 64, d => this.reflected(d, roughness));
  }

  // Of diffuse light by the normal.
  get ambient() {
    return this.map("ambient", 32, n => [...this.diffuse(n), 1]);
  }

  // Directions d lie at d.xy / sqrt(2 + 2 d.z), straight down on the rim.
  map(key, size, light) {
    if (this.maps.has(key)) return this.maps.get(key);
    const gl = this.gl;
    const data = new Float32Array(4 * size * size);
    const texture = tableOf(gl, "RGBA16F", size, size, LINEAR);
    for (let i = 0; i < size * size; i++) {
      const [x, y] = [i % size, Math.floor(i / size)].map(k => (2 * k + 1) / size - 1);
      const r = Math.min(x * x + y * y, 1);
      const flat = 2 * Math.sqrt(1 - r);
      data.set(light([x * flat, y * flat, 1 - 2 * r]), 4 * i);
    }
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, size, size, gl.RGBA, gl.FLOAT, data);
    this.maps.set(key, texture);
    return texture;
  }

  reflected(d, roughness) {
    const width = 0.04 + 0.9 * roughness;
    return [...this.sum(box => seen(box, d, width)), smoothstep(-width, width, d[2])];
  }

  diffuse(n) {
    return this.sum(
      ({normal, size}) =>
        0.13 * this.share * size[0] * size[1] * Math.max(0.35 + 0.65 * dot(n, normal), 0) ** 2,
    );
  }

  sum(part) {
    return this.boxes.reduce((sum, box) => add(sum, box.radiance, this.strength * part(box)), [0, 0, 0]);
  }
}

// How much of a soft box is seen in a direction, with edges as wide as `blur`.
function seen({normal, side, above, size}, d, blur) {
  const along = dot(d, normal);
  if (along <= 0) return 0;
  return [side, above].reduce(
    (inside, axis, i) =>
      (inside * smoothstep(-blur, blur, size[i] - Math.abs(dot(d, axis)) / Math.max(along, 1e-3)) * size[i]) /
      (size[i] + 0.5 * blur),
    1,
  );
}

// A direction by its azimuth and elevation in degrees.
function upwards(right, forward, azimuth, elevation) {
  const [turn, rise] = [azimuth, elevation].map(x => (x * Math.PI) / 180);
  const flat = add(scaled(forward, Math.cos(turn)), right, -Math.sin(turn));
  return add(scaled(flat, Math.cos(rise)), [0, 0, 1], Math.sin(rise));
}

function smoothstep(low, high, x) {
  const t = Math.max(0, Math.min(1, (x - low) / (high - low)));
  return t * t * (3 - 2 * t);
}
