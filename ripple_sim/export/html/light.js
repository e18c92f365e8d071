"use strict";
// The light of a frame, as the renderer sets it (render/visuals/studio.py): lamps, soft boxes, ambient light.
function lightOf(meta, view, bodies, shadowSize) {
  const {studio, lamps, ambient, boxes} = meta.light, floor = meta.floor;
  const albedo = floor ? floor.mean : [0, 0, 0], up = [0, 0, 1];
  const right = unit([view.right[0], view.right[1], 0]), forward = cross(up, right);
  const around = (azimuth, elevation) => {
    const [turn, rise] = [azimuth, elevation].map(x => x * Math.PI / 180);
    const flat = add(scaled(forward, Math.cos(turn)), right, -Math.sin(turn));
    return add(scaled(flat, Math.cos(rise)), up, Math.sin(rise));
  };
  const ways = lamps.map(lamp => studio ? around(92, 44) : lamp.head ? view.back : lamp.direction);
  const onFloor = lamps.reduce((sum, lamp, i) => add(sum, lamp.radiance, strength(lamp, ways[i], view.focus)), [0, 0, 0]);
  const fromFar = lamps.reduce((sum, lamp, i) => lamp.position ? sum : add(sum, lamp.radiance, Math.max(ways[i][2], 0)), ambient);
  const far = studio ? [0.6, 0.6, 0.6] : fromFar.map(x => Math.min(x, 0.6));
  const tint = floor ? far.map((x, i) => x * albedo[i]) : [0.40, 0.42, 0.46];
  const zenith = tint.map((x, i) => x * [0.36, 0.40, 0.48][i]);
  const sky = studio ? tint.map((x, i) => 0.75 * (0.7 * x + 0.3 * zenith[i])) : ambient;
  const normals = boxes.map(box => around(box[0], box[1]));
  const pad = list => [...list, ...Array(4).fill([0, 0, 0])].slice(0, 4);
  return {
    horizon: tint, zenith, sky, floorAlbedo: albedo, floorLight: onFloor, hasFloor: floor ? 1 : 0,
    boxShare: studio ? 1 : 0, boxStrength: studio ? 1 : 0.5, around: ambientUp(sky, studio ? 1 : 0, studio ? 1 : 0.5, boxes, normals),
    lampWay: pad(ways), lampRadiance: pad(lamps.map(lamp => lamp.radiance)), lampPosition: pad(lamps.map(lamp => lamp.position || [0, 0, 0])),
    lampFalloff: pad(lamps.map(lamp => lamp.falloff)), lampShape: pad(lamps.map(lamp => [lamp.position ? 1 : 0, lamp.cutoff, lamp.exponent])),
    boxNormal: normals.map((n, i) => [...n, boxes[i][2]]), boxTangent: normals.map((n, i) => [...unit(cross(up, n)), boxes[i][3]]),
    boxRadiance: boxes.map(box => box.slice(4)), casts: lamps.length && lamps[0].shadow ? 1 : 0, shadowTexel: 1.5 * view.distance / shadowSize,
    shadowMatrix: shadowMatrixOf(lamps.length ? ways[0] : up, lamps.length ? lamps[0].position : null, view),
  };
}

// Share of a lamp's radiance that a patch which faces up receives at a point.
function strength(lamp, way, point) {
  if (!lamp.position) return Math.max(way[2], 0);
  const off = add(lamp.position, point, -1), d = Math.hypot(...off), along = dot(off, way) / d;
  const beam = along >= lamp.cutoff ? Math.pow(Math.max(along, 0), lamp.exponent) : 0;
  return beam / dot(lamp.falloff, [1, d, d * d]) * Math.max(off[2] / d, 0);
}

// Ambient light on the floor: `ambient` of the shader for a normal that points up.
function ambientUp(sky, share, strength, boxes, normals) {
  return boxes.reduce((sum, box, i) => {
    const wrapped = Math.max(0.35 + 0.65 * normals[i][2], 0);
    return add(sum, box.slice(4), share * strength * box[2] * box[3] * 0.13 * wrapped * wrapped);
  }, sky);
}

// World to shadow map of a far lamp, or of one at a position.
function shadowMatrixOf(way, position, view) {
  const half = 0.75 * view.distance, depth = 2.4 * view.distance;
  const off = position ? add(position, view.focus, -1) : way, back = unit(off), distance = Math.hypot(...off);
  const right = unit(cross(Math.abs(back[2]) > 0.99 ? [0, 1, 0] : [0, 0, 1], back)), up = cross(back, right);
  if (!position) return times(orthographic(half, depth), viewOf(view.focus, right, up, back));
  const angle = 360 / Math.PI * Math.atan(half / distance);
  return times(perspective(angle, 1, Math.max(distance - half, 0.05 * distance), distance + depth), viewOf(position, right, up, back));
}
