#version 430
// Deferred shading of the pixels that show solids, in all or some of their samples: every surface that is visible in a
// pixel is lit once.
#include "glsl/view.glsl"

#stage fragment
#include "glsl/g_buffer_samples.glsl"
#include "glsl/height_maps.glsl"
#include "glsl/objects.glsl"
#include "glsl/tone_mapping.glsl"
#include "passes/shading.glsl"

layout(binding = BEHIND_UNIT) uniform sampler2D frame_behind;  // without the transparent object

out vec4 fragment;

const float FULL_LIGHT = 0.70;  // sRGB value from which a heatmap's colour is shown as it is
const float DARKEST = 0.45;
const float NEUTRAL = 0.62;     // albedo under a heatmap
const float SCATTER = 0.2;      // how far light gets under a translucent surface, in sizes of the object
const float CREASE = 0.35;      // difference of the unit normals of two pixels: a radius of three pixels
const float PIXEL_VARIANCE = 1.0 / 24.0;  // of normals in a pixel, over the squares of their steps to the pixels beside
const float MOST_VARIANCE = 0.1;
const vec3 INK = vec3(0.09, 0.11, 0.16);

#if LAYER
// What lies behind the point where a ray, refracted as in water, leaves the object; blurred where that is turbid.
vec3 seen_through(vec3 position, vec3 normal, float thickness, float size, float turbidity)
{
    vec3 bent = refract(normalize(position - eye.xyz), normal, 0.75);
    vec4 exit = view_projection * vec4(position + thickness * size * bent, 1.0);
    vec3 shown = textureLod(frame_behind, 0.5 + 0.5 * exit.xy / exit.w, 6.0 * turbidity).rgb;
    vec3 boxes = environment(bent, 0.1 + 0.5 * turbidity, vec3(0.0)) - environment(bent, 1.0, vec3(0.0));
    return shown + max(boxes, 0.0) * 0.3;
}
#endif

// The surface that a sample shows.
struct SurfaceSample {
    int object;
    vec3 normal;   // without ripples
    vec3 rippled;
    vec3 color;    // square root of the albedo
    float ink;     // opacity of lines on top
    float visibility, thickness;
    vec2 place;    // on the page of charts [texels]
    bool inner;    // whether the object's inner side is seen
};

SurfaceSample surface_sample(ivec2 pixel, int s)
{
    vec4 normal = texelFetch(normals, pixel, s), color = texelFetch(colors, pixel, s);
    SurfaceSample surface;
    surface.object = unpack_object(normal.z);
    surface.normal = octahedral_decode(normal.xy);
    vec2 red_green = unpack_unorm8(color.z), blue_ink = unpack_unorm8(color.w), baked = unpack_unorm8(normal.w);
    surface.color = vec3(red_green, blue_ink.x);
    surface.ink = blue_ink.y;
    surface.rippled = surface.normal;
    surface.visibility = baked.x;
    surface.thickness = 2.0 * baked.y;
    surface.place = color.xy * vec2(textureSize(height_maps, 0).xy);
    surface.inner = unpack_inner(normal.z);
    return surface;
}

// Whether the neighbours in the block of 2 x 2 pixels, to the side and above or below, show the same object as near.
bvec2 same_beside(SurfaceSample surface, float at)
{
    float object = float(surface.object);
    return bvec2(dFdx(object) == 0.0 && abs(dFdx(at)) < 0.02 * at, dFdy(object) == 0.0 && abs(dFdy(at)) < 0.02 * at);
}

// Adds the ripples to a surface; returns the variance of its normals in the pixel, as far as neighbours that are the
// `same` tell, which widens highlights (geometric specular antialiasing: Kaplanyan, Hill, Patney and Lefohn, Filtering
// distributions of normals for shading antialiasing, 2016). Creases do not count: both of their sides are sharp.
float rippled(inout SurfaceSample surface, bvec2 same)
{
    Object object = object_at(surface.object);
    vec2 chart = floor(surface.place / max(object.height_map.w, 1.0));
    bvec2 near = bvec2(same.x && dFdx(chart) == vec2(0.0), same.y && dFdy(chart) == vec2(0.0));
    vec2 across = near.x ? dFdx(surface.place) : vec2(0.0), up = near.y ? dFdy(surface.place) : vec2(0.0);
    float variance;
    vec4 ripple = seen_at(vec3(surface.place, object.height_map.x), across, up, vec3(chart, 1.0) * object.height_map.w,
                          variance) * (surface.inner ? -1.0 : 1.0);
    surface.rippled = normalize(surface.normal - object.rotation * ripple.xyz);
    // cavity occlusion: less light reaches the troughs
    surface.visibility *= 1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / object.place.y);
    vec3 right = dFdx(surface.rippled), above = dFdy(surface.rippled);
    bool smooth_across = same.x && length(dFdx(surface.normal)) < CREASE;
    bool smooth_up = same.y && length(dFdy(surface.normal)) < CREASE;
    float between = (smooth_across ? dot(right, right) : 0.0) + (smooth_up ? dot(above, above) : 0.0);
    return min(max(PIXEL_VARIANCE * between, variance), MOST_VARIANCE);
}

// Colour and opacity; `spread` is the variance of the normals in the pixel, `block` says which neighbours in the block of
// 2 x 2 share their shadows with it.
vec4 lit_solid(SurfaceSample surface, vec3 position, float spread, bvec2 block)
{
    Object object = object_at(surface.object);
    vec3 behind = vec3(0.0);
    bool heatmap = object.place.w > 0.0;
#if LAYER
    behind = seen_through(position, surface.rippled, surface.thickness, object.place.y, object.volume.x);
#endif
    vec3 albedo = heatmap ? vec3(NEUTRAL) : surface.color * surface.color;
    Material m = Material(albedo, object.base.x, object.base.y, object.base.z, object.base.w, object.volume.x,
                          object.volume.y, object.volume.z, surface.thickness, behind, object.place.z,
                          SCATTER * object.volume.x * object.place.y, surface.visibility,
                          int(object.height_map.z), block);
    vec3 shown = tone_mapped(shaded(m, position, surface.rippled, surface.normal, object.place.x, spread));
    float shade = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / FULL_LIGHT, DARKEST, 1.0);
    return vec4(mix(heatmap ? surface.color * shade : shown, INK, surface.ink), object.volume.w);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int left = visible_samples(pixel);
    vec4 sum = vec4(0.0);
    float spread = 0.0, count = float(bitCount(left));
    // pixels that show as many samples belong to the same pass; derivatives across others are undefined
    bvec2 block = bvec2(block_inside(pixel) && dFdx(count) == 0.0, block_inside(pixel) && dFdy(count) == 0.0);
    bool again = false;
    do {
        int first = max(findLSB(left), 0), alike = 1 << first;
        float at = eye_distance(texelFetch(depths, pixel, first).r);
        SurfaceSample surface = surface_sample(pixel, first);
        bvec2 same = same_beside(surface, left == 0 ? -1.0 : at);
        float variance = rippled(surface, bvec2(same.x && !again, same.y && !again));
        spread = again ? spread : variance;
        block = bvec2(block.x && same.x && !again, block.y && same.y && !again);
        // samples of the same surface share their light
        vec3 own = texelFetch(normals, pixel, first).xyz;
        for (int s = 1; s < SAMPLES; ++s) {
            vec3 other = texelFetch(normals, pixel, s).xyz;
            bool near = abs(eye_distance(texelFetch(depths, pixel, s).r) - at) < 0.01 * at;
            alike |= near && other.z == own.z && distance(other.xy, own.xy) < 0.06 ? 1 << s : 0;
        }
        alike &= left;
        left &= ~alike;
        vec4 color = lit_solid(surface, eye.xyz + at * way, spread, block);
        sum += float(bitCount(alike)) / float(SAMPLES) * vec4(dithered(color.rgb) * color.a, color.a);
        again = true;
    } while (left != 0);
    fragment = sum;
}
