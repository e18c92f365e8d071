#version 430
// Pixels that show solids, wholly or in part: every surface that is visible in a pixel is lit once.
#include "gpu/frame_uniforms.glsl"
#include "glsl/ray.glsl"
#include "gpu/g_buffer_read.glsl"
#include "passes/solid_samples.glsl"
#include "visuals/environment.glsl"
#include "glsl/tone_mapping.glsl"
#include "visuals/lights.glsl"
#include "passes/shadow.glsl"
#include "passes/shading.glsl"
#include "gpu/g_buffer.glsl"
#include "surfaces/height_maps.glsl"

layout(binding = 6) uniform sampler2D scene;  // the picture without the clear bodies

struct Object {
    vec4 base;    // roughness, metallic, sheen, coat
    vec4 volume;  // translucency, transparency, emission, opacity
    vec4 place;   // geom, size [m], height of its bumps [m], 1 where its paint goes over the light
    vec4 height_map;  // first layer, texels along an edge of a face; 0 without a height map
    mat3 rotation;
};
layout(std430, binding = 5) readonly buffer Objects { Object objects[]; };

out vec4 fragment;

const float FULL_LIGHT = 0.70;  // sRGB value from which on a painted colour is shown as it is
const float DARKEST = 0.45;
const float NEUTRAL = 0.62;     // albedo under paint
const vec3 INK = vec3(0.09, 0.11, 0.16);

#if LAYER
// The picture where a ray that is bent as in water leaves the body again, blurred where the body is turbid.
vec3 seen_through(vec3 position, vec3 normal, float thickness, float size, float turbidity)
{
    vec3 bent = refract(normalize(position - eye.xyz), normal, 0.75);
    vec4 exit = view_projection * vec4(position + thickness * size * bent, 1.0);
    vec3 shown = textureLod(scene, 0.5 + 0.5 * exit.xy / exit.w, 6.0 * turbidity).rgb;
    vec3 lamps = environment(bent, 0.1 + 0.5 * turbidity, vec3(0.0)) - environment(bent, 1.0, vec3(0.0));
    return shown + max(lamps, 0.0) * 0.3;
}
#endif

// What a sample shows.
struct Spot {
    int object;
    vec3 normal;   // of the surface at large
    vec3 rippled;
    vec3 color;    // square root of the albedo
    float ink;     // of lines on top
    float openness, thickness;
};

Spot spot_at(ivec2 pixel, int s)
{
    vec4 shape = texelFetch(shapes, pixel, s), paint = texelFetch(paints, pixel, s);
    Spot spot;
    // a sample without a surface, which helper invocations may meet, holds any number
    spot.object = min(int(shape.z * 65535.0 + 0.5), objects.length() - 1);
    spot.normal = unfolded(shape.xy);
    vec2 red_green = parted(paint.z), blue_ink = parted(paint.w), baked = parted(shape.w);
    spot.color = vec3(red_green, blue_ink.x);
    spot.ink = blue_ink.y;
    Object object = objects[spot.object];
    vec4 ripple = spline_at(height_map, object.height_map.y, object.height_map.x, unfolded(paint.xy));
    ripple *= object.height_map.y > 0.0 ? 1.0 : 0.0;
    spot.rippled = normalize(spot.normal - object.rotation * ripple.xyz);
    // troughs lie deeper than their surroundings: less light finds its way in
    spot.openness = baked.x * (1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / object.place.y));
    spot.thickness = 2.0 * baked.y;
    return spot;
}

// Whether the neighbours in the block of 2 x 2 pixels, to the side and above or below, show the same object as near.
bvec2 same_beside(Spot spot, float at)
{
    float object = float(spot.object);
    return bvec2(dFdx(object) == 0.0 && abs(dFdx(at)) < 0.02 * at, dFdy(object) == 0.0 && abs(dFdy(at)) < 0.02 * at);
}

// Variance of the normals in the pixel: how far they turn from one to the next.
float spread_of(Spot spot, bvec2 same)
{
    vec3 across = dFdx(spot.rippled), up = dFdy(spot.rippled);
    return min(0.5 * ((same.x ? dot(across, across) : 0.0) + (same.y ? dot(up, up) : 0.0)), 0.2);
}

// Colour and opacity of a spot; `spread` is the variance of the normals in the pixel, `block` says which neighbours in the
// block of 2 x 2 share their shadows with it.
vec4 lit_solid(Spot spot, vec3 position, float spread, bvec2 block)
{
    Object object = objects[spot.object];
    vec3 behind = vec3(0.0);
    bool painted = object.place.w > 0.0;
#if LAYER
    behind = seen_through(position, spot.rippled, spot.thickness, object.place.y, object.volume.x);
#endif
    Material m = Material(painted ? vec3(NEUTRAL) : spot.color * spot.color, object.base.x, object.base.y, object.base.z,
                          object.base.w, object.volume.x, object.volume.y, object.volume.z, spot.thickness, behind,
                          object.place.z, spot.openness, object.height_map.y > 0.0 ? 0 : int(counts.x), block);
    vec3 shown = developed(shaded(m, position, spot.rippled, spot.normal, object.place.x, spread));
    float shade = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / FULL_LIGHT, DARKEST, 1.0);
    return vec4(mix(painted ? spot.color * shade : shown, INK, spot.ink), object.volume.w);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int left = solid_samples(pixel);
    vec4 sum = vec4(0.0);
    float spread = 0.0, count = float(bitCount(left));
    // pixels that show as many samples are of the same pass: what others have reckoned is undefined
    bvec2 block = bvec2(block_inside(pixel) && dFdx(count) == 0.0, block_inside(pixel) && dFdy(count) == 0.0);
    bool again = false;
    do {
        int first = max(findLSB(left), 0), alike = 1 << first;
        float at = eye_distance(texelFetch(depths, pixel, first).r);
        Spot spot = spot_at(pixel, first);
        bvec2 same = same_beside(spot, left == 0 ? -1.0 : at);
        spread = again ? spread : spread_of(spot, same);
        block = bvec2(block.x && same.x && !again, block.y && same.y && !again);
        // samples of the same surface share their light
        vec3 own = texelFetch(shapes, pixel, first).xyz;
        for (int s = 1; s < SAMPLES; ++s) {
            vec3 other = texelFetch(shapes, pixel, s).xyz;
            bool near = abs(eye_distance(texelFetch(depths, pixel, s).r) - at) < 0.01 * at;
            alike |= near && other.z == own.z && distance(other.xy, own.xy) < 0.06 ? 1 << s : 0;
        }
        alike &= left;
        left &= ~alike;
        vec4 color = lit_solid(spot, eye.xyz + at * way, spread, block);
        sum += float(bitCount(alike)) / float(SAMPLES) * vec4(dithered(color.rgb) * color.a, color.a);
        again = true;
    } while (left != 0);
    fragment = sum;
}
