#version 430
// Pixels that show solids, wholly or in part: every surface that is visible in a pixel is lit once.
#include "frame.glsl"
#include "samples.glsl"
#include "studio.glsl"
#include "development.glsl"
#include "lights.glsl"
#include "shadow.glsl"
#include "floor_ray.glsl"
#include "shading.glsl"
#include "geometry.glsl"

layout(binding = 6) uniform sampler2D scene;  // the picture without the clear bodies

struct Object {
    vec4 base;    // roughness, metallic, sheen, coat
    vec4 volume;  // translucency, transparency, emission, opacity
    vec4 place;   // geom, size [m], height of its highest ripple [m], 1 where its paint goes over the light
};
layout(std430, binding = 5) readonly buffer Objects { Object objects[]; };

out vec4 fragment;

const float FULL_LIGHT = 0.70;  // sRGB value from which on a painted colour is shown as it is
const float DARKEST = 0.45;
const float NEUTRAL = 0.62;     // albedo under paint
const vec3 INK = vec3(0.09, 0.11, 0.16);

#if LAYER
uniform int layer;  // number of the only object that is drawn

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

int object_of(ivec2 pixel, int s)
{
    return int(texelFetch(paints, pixel, s).w * 65535.0 + 0.5);
}

// Colour and opacity of what a sample shows.
vec4 lit_solid(ivec2 pixel, int s, vec3 position)
{
    vec4 coded = texelFetch(normals, pixel, s), paint = texelFetch(paints, pixel, s), detail = texelFetch(details, pixel, s);
    Object object = objects[int(paint.w * 65535.0 + 0.5)];
    vec3 rippled = unfolded(coded.xy), normal = unfolded(coded.zw), behind = vec3(0.0);
    bool painted = object.place.w > 0.0;
    float thickness = 2.0 * detail.y;
#if LAYER
    behind = seen_through(position, rippled, thickness, object.place.y, object.volume.x);
#endif
    Material m = Material(painted ? vec3(NEUTRAL) : paint.rgb * paint.rgb, object.base.x, object.base.y, object.base.z,
                          object.base.w, object.volume.x, object.volume.y, object.volume.z, thickness, behind,
                          object.place.z, detail.x);
    vec3 shown = developed(shaded(m, position, rippled, normal, object.place.x, 0.2 * detail.w * detail.w));
    float shade = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)) / FULL_LIGHT, DARKEST, 1.0);
    return vec4(mix(painted ? paint.rgb * shade : shown, INK, detail.z), object.volume.w);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 way = way_of_pixel();
    int left = covered(pixel, floor_distance(way));
#if LAYER
    int own = 0;
    for (int s = 0; s < SAMPLES; ++s)
        own |= object_of(pixel, s) == layer ? 1 << s : 0;
    left &= own;
    if (left == 0)
        discard;
#endif
    vec4 sum = vec4(0.0);
    while (left != 0) {
        // samples of the same surface share their light
        int first = findLSB(left), alike = 1 << first;
        float at = eye_distance(texelFetch(depths, pixel, first).r);
        int object = object_of(pixel, first);
        vec2 normal = texelFetch(normals, pixel, first).zw;
        for (int s = 1; s < SAMPLES; ++s) {
            bool same = abs(eye_distance(texelFetch(depths, pixel, s).r) - at) < 0.01 * at && object_of(pixel, s) == object
                     && distance(texelFetch(normals, pixel, s).zw, normal) < 0.06;
            alike |= same ? 1 << s : 0;
        }
        alike &= left;
        left &= ~alike;
        vec4 color = lit_solid(pixel, first, eye.xyz + at * way);
        sum += float(bitCount(alike)) / float(SAMPLES) * vec4(dithered(color.rgb) * color.a, color.a);
    }
    fragment = sum;
}
