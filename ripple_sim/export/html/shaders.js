// What is drawn. `light`, `lit` and `floor` are the parts of light_shaders.js.

// A triangle that covers everything, behind all that is drawn, with the rays of its points from the eye.
const EVERYWHERE_VERTEX = `
uniform vec3 rayMiddle, rayRight, rayUp;
out vec3 ray;
void main() {
  vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  ray = rayMiddle + p.x * rayRight + p.y * rayUp;
  gl_Position = vec4(p, 0.999999, 1.0);
}`;

const COLOR = 4;  // the attribute of vertices with a colour of their own
const SURFACE_VERTEX = `
layout(location = 0) in vec3 inPoint; layout(location = 1) in vec3 inNormal;
layout(location = 2) in vec2 inUv; layout(location = 3) in float inHeight; layout(location = ${COLOR}) in vec3 inColor;
uniform mat4 model, viewProjection;
out vec3 point, normal; flat out vec3 color; out vec2 uv; out float height;
void main() {
  vec4 world = model * vec4(inPoint, 1.0);
  point = world.xyz; normal = mat3(model) * inNormal; color = inColor; uv = inUv; height = inHeight;
  gl_Position = viewProjection * world;
}`;

const surfaceFragment = (light, lit) => light + lit + `
in vec3 point, normal; flat in vec3 color; in vec2 uv; in float height;
uniform sampler2D image;
out vec4 fragment;
void main() {
  vec3 albedo = color;
#ifdef TEXTURED
  vec4 texel = texture(image, uv);
  if (texel.a < 0.5) discard;  // a hole
  albedo *= linear(texel.rgb);
#endif
  fragment = shownAt(point, gl_FrontFacing ? normal : -normal, albedo, height);
}`;

// Lights points, one a texel; places come with heights. Where pixels are drawn by software, fine meshes of one colour are lit there.
const pointsFragment = (light, lit) => light + lit + `
uniform highp sampler2D places, normals; uniform mat4 model; uniform vec3 color; uniform float open;
out vec4 fragment;
void main() {
  vec4 place = texelFetch(places, ivec2(gl_FragCoord.xy), 0);
  vec3 point = (model * vec4(place.xyz, 1.0)).xyz, normal = mat3(model) * texelFetch(normals, ivec2(gl_FragCoord.xy), 0).xyz;
  if (open > 0.0 && dot(normal, eye - point) < 0.0) normal = -normal;
  fragment = shownAt(point, normal, color, place.w);
}`;

const LIT_POINTS_VERTEX = `
layout(location = 0) in vec3 inPoint;
uniform sampler2D colors; uniform mat4 modelProjection;
out vec4 shown;
void main() {
  shown = texelFetch(colors, ivec2(gl_VertexID & 255, gl_VertexID >> 8), 0);
  gl_Position = modelProjection * vec4(inPoint, 1.0);
}`;

const LIT_POINTS_FRAGMENT = `
in vec4 shown;
out vec4 fragment;
void main() { fragment = shown; }`;

// Where the floor has one colour and no lamp is near, what it shows in light and in shadow is interpolated between the points of
// its cells, as squares, which are nearly proportional to light.
const floorVertex = (light, floor) => light + floor + `
layout(location = 0) in vec2 inPlane;
uniform mat4 floorFrame, viewProjection;
out vec2 plane;
out vec3 point, bright, dark, inMap;
void main() {
  point = (floorFrame * vec4(inPlane, 0.0, 1.0)).xyz;
  plane = inPlane;
  gl_Position = viewProjection * vec4(point, 1.0);
#ifdef PLAIN
  vec3 up = floorFrame[2].xyz;
  bright = floorAt(point, up, floorColor, 1.0); dark = floorAt(point, up, floorColor, 0.0); inMap = inShadowMap(point, vec3(0.0));
  bright *= bright; dark *= dark;
#endif
}`;

const floorFragment = (light, floor) => light + floor + `
in vec2 plane;
in vec3 point, bright, dark, inMap;
uniform mat4 floorFrame; uniform vec4 floorTiling;
uniform sampler2D image;
out vec4 fragment;
void main() {
#if defined(PLAIN) && defined(SHADOW)
  fragment = vec4(sqrt(mix(dark, bright, shadowOn(inMap))), 1.0);
#elif defined(PLAIN)
  fragment = vec4(sqrt(bright), 1.0);
#else
  vec3 albedo = floorColor * linear(texture(image, plane * floorTiling.xy + floorTiling.zw).rgb);
  float shadow = 1.0;
#ifdef SHADOW
  shadow = shadowOn(inShadowMap(point, vec3(0.0)));
#endif
  fragment = vec4(floorAt(point, floorFrame[2].xyz, albedo, shadow), 1.0);
#endif
}`;

const skyFragment = light => light + `
in vec3 ray;
out vec4 fragment;
void main() { fragment = vec4(toneMapped(skyAt(normalize(ray), 0.0)), 1.0); }`;

const DEPTH_VERTEX = `
layout(location = 0) in vec3 inPoint;
uniform mat4 modelProjection;
void main() { gl_Position = modelProjection * vec4(inPoint, 1.0); }`;

const DEPTH_FRAGMENT = `
out vec2 blocker;
void main() { blocker = vec2(1.0, gl_FragCoord.z); }`;

// How much of the first lamp's light does not reach the floor, by places of the shadow map. All that it covers lies above the floor,
// so shadows are means of that, as wide as the mean depth makes penumbras; what is near is looked for in two steps.
const WIDEST_SEARCH = 0.06;  // [widths of the map]
const shadeFragment = size => `
uniform sampler2D blockers;  // share of a texel that is covered, and that times the depth
uniform float softness;
out vec4 shade;
vec2 covered(vec2 at, float radius) {
  float level = max(log2(0.7 * radius * ${size}.0), 0.0), off = exp2(level) / ${2 * size}.0;
  return 0.25 * (textureLod(blockers, at + off, level).xy + textureLod(blockers, at - off, level).xy +
    textureLod(blockers, at + vec2(off, -off), level).xy + textureLod(blockers, at + vec2(-off, off), level).xy);
}
float penumbra(vec2 found) { return softness * max(gl_FragCoord.z - found.y / found.x, 0.0); }
void main() {
  vec2 at = gl_FragCoord.xy / ${size / 2}.0, found = covered(at, ${WIDEST_SEARCH});
  shade = vec4(0.0);
  if (found.x > 1e-4) {
    found = covered(at, penumbra(found));
    if (found.x > 1e-4) {  // what lies less than a texel above the floor casts nothing: about what stands there, texels are covered in part
      found = covered(at, penumbra(found)); shade = vec4(clamp((gl_FragCoord.z * found.x - found.y) * ${size}.0 - found.x, 0.0, found.x));
    }
  }
}`;

// Smooths edges along themselves where no samples do so: fast approximate antialiasing (FXAA, Lottes 2009), by the brightness of green.
const SMOOTH_FRAGMENT = `
uniform sampler2D image;
out vec4 fragment;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 middle = texelFetch(image, at, 0);
  float a = texelFetch(image, at - 1, 0).g, b = texelFetch(image, at + 1, 0).g, c = texelFetch(image, at + ivec2(1, -1), 0).g, d = texelFetch(image, at + ivec2(-1, 1), 0).g;
  float low = min(min(a, b), min(c, d)), high = max(max(a, b), max(c, d));
  fragment = middle;
  if (max(high, middle.g) - min(low, middle.g) > 0.06) {  // returning or discarding would not spare software the rest
    vec2 size = vec2(textureSize(image, 0));
    vec2 along = vec2(a + c - b - d, b + c - a - d);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + max(0.03 * (a + b + c + d), 0.008)), -8.0, 8.0) / size;
    vec2 place = gl_FragCoord.xy / size;
    vec4 inner = 0.5 * (texture(image, place - along / 6.0) + texture(image, place + along / 6.0));
    vec4 wide = 0.5 * inner + 0.25 * (texture(image, place - 0.5 * along) + texture(image, place + 0.5 * along));
    fragment = wide.g < min(low, middle.g) || wide.g > max(high, middle.g) ? inner : wide;
  }
}`;
