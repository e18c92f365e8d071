// The renderer's light (render/glsl/lights.glsl, render/passes/deferred.glsl) with a single shadow
// map and without its occlusion maps. Loops are written out: in software an array at an index that
// changes takes longer than the sums. `near`: whether any of the lamps has a position.
const lightShader = ({lamps, near}) => `
// around: what lights the floor; bounce: what it sends back, and where it lies in shadow
uniform vec3 eye, horizon, zenith, sky, around, bounce, shadedBounce;
uniform vec2 turn;  // of the environment's maps
uniform float casts, shadowTexel;
uniform vec3 lampWay[4], lampRadiance[4], lampPosition[4], lampFalloff[4];
uniform vec3 lampShape[4];  // 1 at a position; cosine of the beam's half angle; exponent
uniform mat4 shadowMatrix;

vec3 inShadowMap(vec3 p, vec3 n) {
  vec3 way = ${near ? "lampShape[0].x > 0.0 ? normalize(lampPosition[0] - p) : lampWay[0]" : "lampWay[0]"};
  vec4 q = shadowMatrix * vec4(p + 1.5 * shadowTexel * (n + way), 1.0);
  return q.xyz / q.w * 0.5 + 0.5;
}
bool outsideShadows(vec3 c) {
  return casts == 0.0 || any(lessThan(c, vec3(0.0))) || any(greaterThan(c, vec3(1.0)));
}

${lamps.map((_, i) => incident(i, near)).join("\n")}

vec3 skyAt(vec3 d, float r) { return mix(horizon, zenith, smoothstep(-0.1 - 0.2 * r, 0.8 + 0.2 * r, d.z)); }

vec3 toneMapped(vec3 radiance) {
  const float shoulder = 0.72;
  float peak = max(radiance.r, max(radiance.g, radiance.b)), excess = max(peak - shoulder, 0.0);
  float compressed = min(peak, shoulder) + (1.0 - shoulder) * excess / (excess + 1.0 - shoulder);
  vec3 c = radiance * (compressed / max(peak, 1e-4));
  c = mix(c, vec3(compressed), 1.0 - 1.0 / (1.0 + 0.18 * excess));
  // sRGB to a thousandth, by square roots: software draws them ten times faster than powers
  vec3 half_power = sqrt(max(c, 0.0)), fourth = sqrt(half_power), eighth = sqrt(fourth);
  vec3 power = 0.662002687 * half_power + 0.684122060 * fourth - 0.323583601 * eighth - 0.022541147 * c;
  return mix(12.92 * c, power, step(0.0031308, c));
}
// its inverse to half a hundredth, for the same reason
vec3 linear(vec3 c) { return c * (c * (c * 0.305 + 0.682) + 0.013); }
`;

// Radiance of a lamp at a point, and the way to it.
const incident = (i, near) => `vec3 incident${i}(vec3 p, out vec3 way) {
  way = lampWay[${i}];
  ${
    near
      ? `if (lampShape[${i}].x > 0.0) {
    vec3 off = lampPosition[${i}] - p;
    float d = length(off);
    way = off / d;
    float along = dot(way, lampWay[${i}]);
    float beam = along >= lampShape[${i}].y ? pow(max(along, 0.0), lampShape[${i}].z) : 0.0;
    return lampRadiance[${i}] * beam / dot(lampFalloff[${i}], vec3(1.0, d, d * d));
  }`
      : ""
  }
  return lampRadiance[${i}];
}`;

const SPREAD = 1.8; // between samples of the shadow map, each of which is linear between texels [texels]
// The mean of the shadow map's samples round a point.
function samples(taps, size) {
  const along = Array.from({length: taps}, (_, i) => ((SPREAD * (i - 0.5 * (taps - 1))) / size).toFixed(9));
  const all = along.flatMap(x => along.map(y => `texture(shadowMap, vec3(c.x + ${x}, c.y + ${y}, c.z))`));
  return `(${all.join(" + ")}) / ${all.length.toFixed(1)}`;
}

// What a surface reflects of a lamp. The first casts shadows; what turns away from it is dark
// without a look into their map, unless it is translucent.
const reflectedOf = ({gloss}, i) => `
  radiance = incident${i}(point, way);
  shadow = 1.0;
  ${i ? "" : "if (dot(n, way) > 0.0 || volume.x > 0.0) shadow = shadowOf(inShadowMap(point, n));"}
  reflected(radiance, way, shadow, ${gloss.toFixed(4)}, n, view, albedo, f0, rough, direct, highlight);`;

// What a surface reflects, in linear light. COAT is defined where a look has one: without, its
// look-up costs nothing. With `taps` of the shadow map along each side, which has `shadowSize`
// texels.
const litShader = ({lamps, taps, shadowSize}) => `
uniform sampler2DShadow shadowMap;
float shadowOf(vec3 c) { return outsideShadows(c) ? 1.0 : ${samples(taps, shadowSize)}; }
uniform sampler2D ambientMap, mirrorMap, coatMap;
uniform vec4 base, volume;  // roughness, metallic, sheen, coat; translucency, transparency, emission, opacity
vec3 fresnel(vec3 f0, float c) {
  float m = max(1.0 - c, 0.0), m2 = m * m;
  return f0 + (1.0 - f0) * (m2 * m2 * m);
}
float ggx(float nh, float r) {
  float a2 = r * r * r * r, d = nh * nh * (a2 - 1.0) + 1.0;
  return a2 / (d * d);
}
void reflected(vec3 radiance, vec3 way, float shadow, float gloss, vec3 n, vec3 view, vec3 albedo,
    vec3 f0, float rough, inout vec3 direct, inout vec3 highlight) {
  vec3 halfway = normalize(view + way);
  float nl = dot(n, way);
  vec3 wrap = 0.6 * volume.x * albedo;  // of what light goes through
  vec3 diffuse = max(nl + wrap, 0.0) / ((1.0 + wrap) * (1.0 + wrap));
  direct += radiance * diffuse * mix(shadow, 1.0, 0.35 * volume.x);
  float facets = 0.25 * ggx(max(dot(n, halfway), 0.0), rough);
  float reach = gloss * shadow * clamp(nl * 4.0, 0.0, 1.0);
  highlight += radiance * (reach * facets) * fresnel(f0, max(dot(view, halfway), 0.0));
}
// A map of light by direction, the same for all that turn with the camera.
vec4 from(sampler2D map, vec3 d) {
  vec2 turned = vec2(dot(d.xy, turn), turn.x * d.y - turn.y * d.x);
  return texture(map, 0.5 + 0.5 * turned * inversesqrt(max(2.0 + 2.0 * d.z, 2e-6)));
}
uniform sampler2D shades;
uniform vec4 floorPlane;  // its normal, and how high it lies along that
// What the floor sends back along a ray that may meet it.
vec3 bounceTo(vec3 point, vec3 d) {
  float height = dot(floorPlane.xyz, point) - floorPlane.w, down = -dot(floorPlane.xyz, d);
  vec3 c = inShadowMap(point + d * (max(height, 0.0) / max(down, 0.1)), vec3(0.0));
  float lightness = down < 0.1 || outsideShadows(c) ? 1.0 : 1.0 - texture(shades, c.xy).x;
  return mix(shadedBounce, bounce, lightness);
}
vec3 mirrored(sampler2D map, vec3 point, vec3 d, float roughness) {
  vec4 boxes = from(map, d);
  return boxes.rgb + mix(bounceTo(point, d), 0.75 * skyAt(d, roughness), boxes.a);
}
vec3 lit(vec3 point, vec3 normal, vec3 albedo) {
  vec3 view = normalize(eye - point), n = normalize(normal);
  n = normalize(n + max(0.1 - dot(n, view), 0.0) * view);
  float nv = clamp(dot(n, view), 0.1, 1.0), rough = max(base.x, 0.0632);
  float edge = 1.0 - nv, edge3 = edge * edge * edge;
  vec3 mirror = reflect(-view, n);
  vec3 f0 = mix(vec3(0.04), albedo, base.y), direct = vec3(0.0), highlight = vec3(0.0);
  vec3 way, radiance;
  float shadow;
${lamps.map(reflectedOf).join("")}
  vec3 ambience = from(ambientMap, n).rgb + mix(bounce, sky, 0.5 + 0.5 * n.z);
  vec3 shade = albedo * (direct + ambience);
  shade *= 1.0 - base.y;
  vec3 reflectance = f0 + (max(vec3(1.0 - rough), f0) - f0) * (edge3 * edge * edge);
  shade += (base.z * edge3 * ambience + volume.z) * albedo;
  shade += mirrored(mirrorMap, point, mirror, rough) * reflectance + highlight;
#ifdef COAT
  float edge5 = edge3 * edge * edge, coat = base.w * (0.04 + 0.96 * edge5);
  shade = mix(shade, mirrored(coatMap, point, mirror, 0.06), coat);
#endif
  return shade;
}
uniform sampler2D heatColors;
// What the screen shows of a point, times its opacity.
vec4 shownAt(vec3 point, vec3 normal, vec3 albedo, vec3 emitted, float height) {
  vec3 shown = toneMapped(lit(point, normal, albedo) + emitted);
#ifdef HEAT
  float light = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / 0.70, 0.45, 1.0);
  shown = texture(heatColors, vec2(0.5 + 0.5 * clamp(height, -1.0, 1.0), 0.5)).rgb * light;
#endif
  float facing = clamp(dot(normalize(normal), normalize(eye - point)), 0.1, 1.0);
  float opacity = volume.w * (1.0 - 0.6 * volume.y * facing);
  return vec4(shown * opacity, opacity);
}
`;

// What a lamp adds to the floor's light; the first casts shadows.
const onFloorOf = i => `  radiance = incident${i}(point, way);
  light += radiance * max(dot(way, up), 0.0)${i ? "" : " * shadow"};`;

// What the screen shows of the floor, which fades into the sky.
const floorShader = ({lamps}) => `
uniform sampler2D shades;
float shadowOn(vec3 c) { return outsideShadows(c) ? 1.0 : 1.0 - texture(shades, c.xy).x; }
uniform vec3 focus, floorColor, fade;
vec3 floorAt(vec3 point, vec3 up, vec3 albedo, float shadow) {
  vec3 light = around, way, radiance;
${lamps.map((_, i) => onFloorOf(i)).join("\n")}
  float share = smoothstep(fade.x, fade.y, distance(point, focus) / fade.z);
  return toneMapped(mix(albedo * light, skyAt(normalize(point - eye), 0.0), share));
}
`;
