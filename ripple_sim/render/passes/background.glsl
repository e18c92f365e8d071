#version 410
// The floor and the sky behind it. Without SHADOW, no shadows are drawn, and pixels where one may fall are marked by their
// depth; with SHADOW, the marked pixels are drawn. Each pixel stands for a block of BLOCK x BLOCK pixels of the frame.
#define OWN_POINTS (BLOCK > 1)
#include "glsl/view.glsl"

#stage fragment
#include "glsl/floor_map.glsl"
#include "glsl/fog.glsl"
#include "glsl/lights.glsl"
#include "glsl/soft_shadows.glsl"
#include "glsl/tone_mapping.glsl"

layout(binding = FLAT_IMAGE_UNIT) uniform sampler2D floor_image;

uniform vec4 tiling;   // texture coordinates a metre, and at the origin
uniform vec3 tint;     // of the image

out vec4 fragment;

#if MIRROR
layout(binding = MIRROR_UNIT) uniform sampler2D mirror;  // the scene as the floor reflects it, tone mapped

uniform float reflectance;
#endif

const float STEEPEST = 0.03;  // greatest change from one block to the next where the background is smooth
const float RIM = 0.5;         // width of the rough strip on either side of the floor's edges [blocks]
const float HIGHEST_LEVEL = 4.0;  // highest level of the floor map
const float BOUNCE_LEVEL = 2.3;   // level at which the few points of the map's search are no longer visible
const float LARGEST = 0.04;       // greatest block [half widths of the floor map]: larger blocks would miss shadows

const float LOWEST = SKYBOX > 0 ? 0.0 : -1.0;  // a skybox continues below the horizon, which the floor hides

#if HORIZON
layout(binding = HORIZON_UNIT) uniform sampler2D horizon_colors;  // of the skybox, by the azimuth
#endif

// Colour that the floor fades into. Details of a skybox would be drawn out downwards.
vec3 horizon_at(vec3 direction)
{
#if HORIZON
    return textureLod(horizon_colors, vec2(atan(direction.y, direction.x) / TWO_PI, 0.5), 0.0).rgb;
#else
    return sky_at(vec3(direction.xy, max(direction.z, LOWEST)), 0.0);
#endif
}

#if !SHADOW
// Whether a shadow may fall on a point of the floor; `near` is its texel of the floor map.
bool may_be_shaded(vec2 place, vec2 near)
{
    vec2 off = abs(place - 0.5);
    bool boxed = false;
    for (int i = 0; i < SHADOWS; ++i) {
        vec4 box = shadow_at(i).floor;
        boxed = boxed || counts.w > float(i) && all(greaterThan(place, box.xy)) && all(lessThan(place, box.zw));
    }
    return boxed && (max(off.x, off.y) > 0.5 || near.g > 0.0);
}
#endif

#if !BACKDROP
// Haze as in MuJoCo: a cone about the eye, at the distance of the skybox, from the floor up to the height of the eye. The
// cone's foot is nearer by the ring's width, a share of that distance. Haze is densest at some height, and clear at the foot
// and the top.
vec3 hazed(vec3 shown)
{
    float slope = way_local.z / max(length(way_local.xy), 1e-9), height = eye_local.z / haze_cone.z;
    // how far below the eye the ray meets the cone, as a share of the eye's height
    float below = slope / max(height + haze_cone.x * slope, 1e-9);
    float up = 1.0 - below, dense = haze_cone.y;
    float share = min(up / dense, below / (1.0 - dense));
    return mix(shown, fogged(haze.rgb, haze_cone.z), haze.w * (eye_local.z > 0.0 ? clamp(share, 0.0, 1.0) : 0.0));
}
#endif

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    bool met = meets_floor();
    float at = floor_distance();
    vec2 plane = eye_local.xy + at * way_local.xy;
    // the lights are near: a pool of light about the focus, and the background's colour beyond
    float away = length(vec3(plane - focus_local.xy, focus_local.z));
    // antialiasing of the floor's own edges
    vec2 inside = limits.xy - abs(plane), filled = clamp(float(BLOCK) * inside / fwidth(inside), 0.0, 1.0);
    float edge = 1.0 - min(filled.x, filled.y);
    float fade = met ? max(smoothstep(floor_fade.x, floor_fade.y, away / eye.w), edge) : 1.0;
#if TILED
    vec3 albedo = texture(floor_image, plane * tiling.xy + tiling.zw).rgb * tint;
#else
    vec3 albedo = floor_albedo.rgb;
#endif
    vec3 world = start + at * way;
    vec2 place = floor_map_position(plane);
    // blocks of 2 x 2 texels that share their light are texels of the next level
    float level = 1.0;
#if BLOCK > 1
    // in higher levels, texels at the map's edge, which stand for everything beyond it, are as dark as texels far inside
    level = clamp(textureQueryLod(floor_visibility, place).y + 1.0, level, HIGHEST_LEVEL);
#endif
    vec2 near = textureLod(floor_visibility, place, level).rg;
    vec3 bounce = textureLod(floor_bounce, place, BOUNCE_LEVEL).rgb;
    vec3 shadow[SHADOWS];
    for (int i = 0; i < SHADOWS; ++i)
        shadow[i] = vec3(1.0);
    float blur = 0.0;
#if SHADOW
    // the search for blockers is shared where all four pixels of a block show the floor
    bvec2 block = bvec2(BLOCK == 1 && block_mean(met ? 0.0 : 1.0, bvec2(true)) == 0.0);
#if BLOCK > 1
    // narrow penumbras are widened, so that none falls between blocks, and are shaded pixel by pixel
    blur = 0.5 * length(fwidth(plane));
#endif
    bool partly = false;
    for (int i = 0; i < SHADOWS; ++i) {
        shadow[i] = light_arriving(i, world, floor_normal.xyz, -1.0, blur, block);
#if OWN_POINTS
        partly = partly || any(greaterThan(shadow[i] * (1.0 - shadow[i]), vec3(UNSEEN)));
#endif
    }
#else
    // all four pixels of a block, so that they can share their search for blockers
    bool shaded = met && may_be_shaded(place, near);
    gl_FragDepth = block_mean(shaded ? 1.0 : 0.0, bvec2(true)) > 0.0 ? SHADED_LEVEL : OPEN_LEVEL;
#endif
#if NEAR_LIGHTS
    vec3 light = vec3(0.0), unshaded = vec3(0.0);
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 towards;
        vec3 arrives = incident(light_at(i), world, towards) * max(dot(floor_normal.xyz, towards), 0.0);
        light += arrives * (i < SHADOWS ? shadow[i] : vec3(1.0));
        unshaded += arrives;
    }
#else
    vec3 unshaded = floor_light.rgb, light = unshaded;
#if SHADOW
    for (int i = 0; i < SHADOWS; ++i) {
        Light from = light_at(i);
        vec3 arrives = from.radiance.rgb * max(dot(floor_normal.xyz, from.direction.xyz), 0.0);
        light -= (1.0 - shadow[i]) * arrives;
    }
#endif
#endif
    unshaded += around + key_box;
    light += (around + shadow[0] * key_box) * (0.15 + 0.85 * near.r);
#if CUT_OUT
    // only the shadows are left of the floor
    fragment = vec4(vec3(0.0), (1.0 - fade) * (1.0 - light.g / max(unshaded.g, 1e-6)));
#else
    vec3 direction = normalize(way);
#if BACKDROP
    vec3 far = met && edge == 0.0 ? horizon_at(direction) : sky_at(direction, 0.0);
    vec3 shown = tone_mapped(mix(albedo * (light + bounce), far, fade));
#if MIRROR
    // as in MuJoCo, the reflectance does not depend on the angle
    shown = mix(shown, textureLod(mirror, 0.5 + 0.5 * screen, 0.0).rgb, reflectance * (1.0 - fade));
#endif
#else
    vec3 shown = tone_mapped(albedo * (light + bounce));
#if MIRROR
    shown += reflectance * textureLod(mirror, 0.5 + 0.5 * screen, 0.0).rgb;
#endif
    vec3 far = encoded(sky_at(direction, 0.0));
    far = mix(far, fogged(far, haze_cone.z), shown_far.z);  // without a skybox the background is black and has no fog
    shown = hazed(mix(fogged(shown, at), far, fade));
#endif
#if BLOCK > 1
    vec2 margin = -beside_edges(), near_edge = RIM * fwidth(margin);
    bool rough = all(greaterThan(margin, -near_edge)) && any(lessThan(margin, near_edge)), steep = any(greaterThan(fwidth(shown), vec3(STEEPEST)));
#if SHADOW
    rough = rough || (partly ? in_narrow : steep) || 2.0 * blur > LARGEST * floor_map.z;
#else
    rough = rough || steep;
#endif
    fragment = vec4(shown, rough ? 0.5 : met ? 1.0 : 0.0);
#else
    fragment = vec4(dithered(shown), 1.0);
#endif
#endif
}
