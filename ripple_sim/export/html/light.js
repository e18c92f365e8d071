const SHADOW_WIDTH = 1.5; // of the shadow map [distances of the camera]
const DARK = {position: null, size: 0, shadow: false}; // where there is no lamp

// The light of a frame, as the renderer sets it (render/visuals/lights.py): lamps, sky, what the
// floor sends back. `boxes` is the soft boxes' light on the floor.
function lightOf(meta, view, boxes, shadowSize) {
  const {studio, lamps, ambient} = meta.light;
  const floor = meta.floor;
  const [first = DARK] = lamps;
  const albedo = floor ? floor.mean : [0, 0, 0];
  const up = [0, 0, 1];
  const right = unit([view.right[0], view.right[1], 0]);
  const forward = cross(up, right);
  const ways = lamps.map(lamp =>
    studio ? upwards(right, forward, 92, 44) : lamp.head ? view.back : lamp.direction,
  );
  const onFloor = lamps.reduce(
    (sum, lamp, i) => add(sum, lamp.radiance, strength(lamp, ways[i], view.focus)),
    [0, 0, 0],
  );
  const fromFar = lamps.reduce(
    (sum, lamp, i) => (lamp.position ? sum : add(sum, lamp.radiance, Math.max(ways[i][2], 0))),
    ambient,
  );
  const far = studio ? [0.6, 0.6, 0.6] : fromFar.map(x => Math.min(x, 0.6));
  const tint = floor ? far.map((x, i) => x * albedo[i]) : [0.4, 0.42, 0.46];
  const zenith = tint.map((x, i) => x * [0.36, 0.4, 0.48][i]);
  const sky = studio ? tint.map((x, i) => 0.75 * (0.7 * x + 0.3 * zenith[i])) : ambient;
  const pad = list => [...list, ...Array(4).fill([0, 0, 0])].slice(0, 4);
  const around = add(sky, boxes);
  // about a third lies in shadow
  const bounce = floor ? albedo.map((x, i) => x * (0.7 * onFloor[i] + around[i])) : scaled(sky, 0.8);
  return {
    horizon: tint,
    zenith,
    sky,
    around,
    bounce,
    shadedBounce: floor ? albedo.map((x, i) => x * around[i]) : bounce,
    turn: right.slice(0, 2),
    lampWay: pad(ways),
    lampRadiance: pad(lamps.map(lamp => lamp.radiance)),
    lampPosition: pad(lamps.map(lamp => lamp.position || [0, 0, 0])),
    lampFalloff: pad(lamps.map(lamp => lamp.falloff)),
    lampShape: pad(lamps.map(lamp => [lamp.position ? 1 : 0, lamp.cutoff, lamp.exponent])),
    lampSize: first.size,
    casts: first.shadow ? 1 : 0,
    shadowTexel: (SHADOW_WIDTH * view.distance) / shadowSize,
    ...shadowMapOf(ways[0] || up, first, view),
  };
}

// Share of a lamp's radiance that a patch which faces up receives at a point.
function strength(lamp, way, point) {
  if (!lamp.position) return Math.max(way[2], 0);
  const off = add(lamp.position, point, -1);
  const d = Math.hypot(...off);
  const along = dot(off, way) / d;
  const beam = along >= lamp.cutoff ? Math.pow(Math.max(along, 0), lamp.exponent) : 0;
  return (beam / dot(lamp.falloff, [1, d, d * d])) * Math.max(off[2] / d, 0);
}

// World to shadow map of a far lamp, or of one at a position, and the radius of a penumbra over the
// depth between what casts it and where it falls, both in the map.
function shadowMapOf(way, {position, size}, view) {
  const half = 0.5 * SHADOW_WIDTH * view.distance;
  const depth = 2.4 * view.distance;
  const off = position ? add(position, view.focus, -1) : way;
  const back = unit(off);
  const distance = Math.hypot(...off);
  const right = unit(cross(Math.abs(back[2]) > 0.99 ? [0, 1, 0] : [0, 0, 1], back));
  const up = cross(back, right);
  if (!position)
    return {
      shadowMatrix: times(orthographic(half, depth), viewOf(view.focus, right, up, back)),
      softness: (size * depth) / half,
    };
  const near = Math.max(distance - half, 0.05 * distance);
  const far = distance + depth;
  const angle = (360 / Math.PI) * Math.atan(half / distance);
  return {
    shadowMatrix: times(perspective(angle, 1, near, far), viewOf(position, right, up, back)),
    softness: (size * distance * (1 / near - 1 / far)) / (2 * half),
  };
}
