"use strict";
// The renderer's surface shading (render/passes/shading.glsl) with a single shadow map and without its occlusion maps.
// LAMPS, NEAR (whether any lamp has a position), SHADOW_SIZE and TAPS (of the shadow map, along each side) are defined when it is
// compiled.
const LIGHT = `
precision highp float;
precision highp sampler2DShadow;
uniform vec3 eye, horizon, zenith, sky, floorAlbedo, floorLight, around;
uniform float boxShare, hasFloor, boxStrength, casts, shadowTexel;
uniform vec3 lampWay[4], lampRadiance[4], lampPosition[4], lampFalloff[4];
uniform vec3 lampShape[4];  // 1 at a position; cosine of the beam's half angle; exponent
uniform vec4 boxNormal[3], boxTangent[3];
uniform vec3 boxRadiance[3];
uniform mat4 shadowMatrix;
uniform sampler2DShadow shadowMap;

float shadowAt(vec3 p, vec3 n) {
  if (casts == 0.0) return 1.0;
  vec3 way = lampShape[0].x > 0.0 ? normalize(lampPosition[0] - p) : lampWay[0];
  vec4 q = shadowMatrix * vec4(p + 1.5 * shadowTexel * (n + way), 1.0);
  vec3 c = q.xyz / q.w * 0.5 + 0.5;
  if (any(lessThan(c, vec3(0.0))) || any(greaterThan(c, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int i = 0; i < TAPS; ++i) for (int j = 0; j < TAPS; ++j)
    sum += texture(shadowMap, vec3(c.xy + (vec2(i, j) - 0.5 * float(TAPS - 1)) / SHADOW_SIZE, c.z));
  return sum / float(TAPS * TAPS);
}

vec3 incident(int i, vec3 p, out vec3 way) {
  way = lampWay[i];
#if NEAR
  if (lampShape[i].x == 0.0)
#endif
    return lampRadiance[i];
#if NEAR
  vec3 off = lampPosition[i] - p;
  float d = length(off);
  way = off / d;
  float along = dot(way, lampWay[i]);
  float beam = along >= lampShape[i].y ? pow(max(along, 0.0), lampShape[i].z) : 0.0;
  return lampRadiance[i] * beam / dot(lampFalloff[i], vec3(1.0, d, d * d));
#endif
}

vec3 skyAt(vec3 d, float r) { return mix(horizon, zenith, smoothstep(-0.1 - 0.2 * r, 0.8 + 0.2 * r, d.z)); }

float softBox(vec3 d, vec4 n, vec4 t, float blur) {
  float along = dot(d, n.xyz);
  vec2 hit = vec2(dot(d, t.xyz), dot(d, cross(n.xyz, t.xyz))) / max(along, 1e-3), size = vec2(n.w, t.w);
  vec2 inside = smoothstep(-blur, blur, size - abs(hit)) * (size / (size + 0.5 * blur));
  return along > 0.0 ? inside.x * inside.y : 0.0;
}

vec3 environment(vec3 d, float r, vec3 bounce) {
  float width = 0.04 + 0.9 * r;
  vec3 radiance = mix(bounce, 0.75 * skyAt(d, r), smoothstep(-width, width, d.z));
  for (int i = 0; i < 3; ++i) radiance += boxStrength * boxRadiance[i] * softBox(d, boxNormal[i], boxTangent[i], width);
  return radiance;
}

vec3 ambient(vec3 n, vec3 bounce) {
  vec3 radiance = mix(bounce, sky, 0.5 + 0.5 * n.z);
  for (int i = 0; i < 3; ++i) {
    float w = max(0.35 + 0.65 * dot(n, boxNormal[i].xyz), 0.0);
    radiance += boxShare * boxStrength * boxRadiance[i] * boxNormal[i].w * boxTangent[i].w * 0.13 * w * w;
  }
  return radiance;
}

vec3 toneMapped(vec3 radiance) {
  const float shoulder = 0.72;
  float peak = max(radiance.r, max(radiance.g, radiance.b)), excess = max(peak - shoulder, 0.0);
  float compressed = min(peak, shoulder) + (1.0 - shoulder) * excess / (excess + 1.0 - shoulder);
  vec3 c = radiance * (compressed / max(peak, 1e-4));
  c = mix(c, vec3(compressed), 1.0 - 1.0 / (1.0 + 0.18 * excess));
  // sRGB to a thousandth, by square roots: software draws them ten times faster than powers
  vec3 half_power = sqrt(max(c, 0.0)), fourth = sqrt(half_power), eighth = sqrt(fourth);
  return mix(12.92 * c, 0.662002687 * half_power + 0.684122060 * fourth - 0.323583601 * eighth - 0.022541147 * c, step(0.0031308, c));
}
// its inverse to half a hundredth, for the same reason
vec3 linear(vec3 c) { return c * (c * (c * 0.305 + 0.682) + 0.013); }
`;

// How a surface is lit, in linear light; it is all that `albedo` allows.
const LIT = `
uniform vec4 base, volume;  // roughness, metallic, sheen, coat; translucency, transparency, emission, opacity
vec3 fresnel(vec3 f0, float c) { float m = max(1.0 - c, 0.0), m2 = m * m; return f0 + (1.0 - f0) * m2 * m2 * m; }
float ggx(float nh, float r) { float a2 = r * r * r * r, d = nh * nh * (a2 - 1.0) + 1.0; return a2 / (d * d); }
vec3 lit(vec3 point, vec3 normal, vec3 albedo) {
  vec3 view = normalize(eye - point), n = normalize(normal);
  n = normalize(n + max(0.1 - dot(n, view), 0.0) * view);
  float nv = clamp(dot(n, view), 0.1, 1.0), rough = max(base.x, 0.0632), edge = 1.0 - nv;
  vec3 f0 = mix(vec3(0.04), albedo, base.y), mirror = reflect(-view, n);
  vec3 bounce = hasFloor > 0.0 ? floorAlbedo * (0.7 * floorLight + around) : sky * 0.8;  // about a third lies in shadow
  vec3 wrap = 0.6 * volume.x * albedo, direct = vec3(0.0), highlight = vec3(0.0);
  float shadow = shadowAt(point, n);
  for (int i = 0; i < LAMPS; ++i) {
    vec3 way;
    vec3 radiance = incident(i, point, way), halfway = normalize(view + way);
    float nl = dot(n, way), seen = i == 0 ? shadow : 1.0;
    direct += radiance * max(nl + wrap, 0.0) / ((1.0 + wrap) * (1.0 + wrap)) * mix(seen, 1.0, 0.35 * volume.x);
    highlight += radiance * seen * clamp(nl * 4.0, 0.0, 1.0) * fresnel(f0, max(dot(view, halfway), 0.0)) * ggx(max(dot(n, halfway), 0.0), rough) * 0.25;
  }
  vec3 ambience = ambient(n, bounce);
  vec3 shade = albedo * (direct + ambience) * (1.0 - base.y) + volume.z * albedo;
  shade += base.z * albedo * ambience * edge * edge * edge;
  vec3 atEdge = f0 + (max(vec3(1.0 - rough), f0) - f0) * edge * edge * edge * edge * edge;
  vec3 gloss = environment(mirror, rough, bounce) * atEdge + highlight;
  if (base.w == 0.0) return shade + gloss;
  float coat = base.w * fresnel(vec3(0.04), nv).x;
  return (shade + gloss) * (1.0 - coat) + coat * environment(mirror, 0.06, bounce);
}
float opacityAt(vec3 point, vec3 normal) { return volume.w * (1.0 - 0.6 * volume.y * clamp(dot(normalize(normal), normalize(eye - point)), 0.1, 1.0)); }
`;

const HEATED = `
uniform sampler2D heatColors;
vec3 heated(vec3 shown, float height) {
  float light = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / 0.70, 0.45, 1.0);
  return texture(heatColors, vec2(0.5 + 0.5 * clamp(height, -1.0, 1.0), 0.5)).rgb * light;
}
`;

const SURFACE_VERTEX = `#version 300 es
layout(location = 0) in vec3 inPoint; layout(location = 1) in vec3 inNormal;
layout(location = 2) in vec2 inUv; layout(location = 3) in float inHeight;
uniform mat4 model, viewProjection;
out vec3 point, normal; out vec2 uv; out float height;
void main() {
  vec4 world = model * vec4(inPoint, 1.0);
  point = world.xyz; normal = mat3(model) * inNormal; uv = inUv; height = inHeight;
  gl_Position = viewProjection * world;
}`;

const SURFACE_FRAGMENT = LIGHT + LIT + HEATED + `
in vec3 point, normal; in vec2 uv; in float height;
uniform vec3 color; uniform float heat, textured; uniform sampler2D image;
out vec4 fragment;
void main() {
  vec3 n = gl_FrontFacing ? normal : -normal, albedo = color * (textured > 0.0 ? linear(texture(image, uv).rgb) : vec3(1.0));
  vec3 shown = toneMapped(lit(point, n, heat > 0.0 ? vec3(0.62) : albedo));
  if (heat > 0.0) shown = heated(shown, height);
  float opacity = opacityAt(point, n);
  fragment = vec4(shown * opacity, opacity);
}`;

// The same, lit at vertices: for fine meshes of one colour where pixels are drawn by software.
const FINE_VERTEX = LIGHT + LIT + `
layout(location = 0) in vec3 inPoint; layout(location = 1) in vec3 inNormal; layout(location = 3) in float inHeight;
uniform mat4 model, viewProjection; uniform vec3 color; uniform float heat, open;
out vec4 shown; out float height;
void main() {
  vec4 world = model * vec4(inPoint, 1.0);
  vec3 normal = mat3(model) * inNormal;
  float facing = dot(normal, normalize(eye - world.xyz));
  if (open > 0.0 && facing < 0.0) normal = -normal;
  shown = vec4(0.0);
  if (open > 0.0 || facing > -0.5)  // the others are on triangles that face away
    shown = vec4(toneMapped(lit(world.xyz, normal, heat > 0.0 ? vec3(0.62) : color)), opacityAt(world.xyz, normal));
  height = inHeight;
  gl_Position = viewProjection * world;
}`;

const FINE_FRAGMENT = `precision highp float;
` + HEATED + `
in vec4 shown; in float height;
uniform float heat;
out vec4 fragment;
void main() { fragment = vec4((heat > 0.0 ? heated(shown.rgb, height) : shown.rgb) * shown.a, shown.a); }`;

const FLOOR_VERTEX = `#version 300 es
uniform mat4 floorFrame, viewProjection; uniform vec3 focus; uniform vec2 floorHalf; uniform float reach;
out vec2 plane; out vec3 point;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  vec3 off = focus - floorFrame[3].xyz;
  vec2 middle = vec2(dot(off, floorFrame[0].xyz), dot(off, floorFrame[1].xyz));
  plane = clamp(middle + corner * reach, -floorHalf, floorHalf);
  point = (floorFrame * vec4(plane, 0.0, 1.0)).xyz;
  gl_Position = viewProjection * vec4(point, 1.0);
}`;

const FLOOR_FRAGMENT = LIGHT + `
in vec2 plane; in vec3 point;
uniform mat4 floorFrame; uniform vec4 floorTiling; uniform vec3 focus, floorColor, fade; uniform float floorTextured;
uniform sampler2D image;
out vec4 fragment;
void main() {
  vec3 up = floorFrame[2].xyz, albedo = floorColor, light = vec3(0.0), towards;
  if (floorTextured > 0.0) albedo *= linear(texture(image, plane * floorTiling.xy + floorTiling.zw).rgb);
  float shadow = shadowAt(point, up), share = smoothstep(fade.x, fade.y, distance(point, focus) / fade.z);
  for (int i = 0; i < LAMPS; ++i) {
    vec3 arrives = incident(i, point, towards);
    light += arrives * max(dot(towards, up), 0.0) * (i == 0 ? shadow : 1.0);
  }
  vec3 far = skyAt(normalize(point - eye), 0.0);
  fragment = vec4(toneMapped(mix(albedo * (light + around), far, share)), 1.0);
}`;

const SKY_VERTEX = `#version 300 es
uniform vec3 rayMiddle, rayRight, rayUp;
out vec3 ray;
void main() {
  vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  ray = rayMiddle + p.x * rayRight + p.y * rayUp;
  gl_Position = vec4(p, 0.999999, 1.0);
}`;

const SKY_FRAGMENT = LIGHT + `
in vec3 ray;
out vec4 fragment;
void main() { fragment = vec4(toneMapped(skyAt(normalize(ray), 0.0)), 1.0); }`;

const DEPTH_VERTEX = `#version 300 es
layout(location = 0) in vec3 inPoint;
uniform mat4 model, viewProjection;
void main() { gl_Position = viewProjection * model * vec4(inPoint, 1.0); }`;

const DEPTH_FRAGMENT = `#version 300 es
precision highp float;
void main() {}`;
