#version 430
// What a pixel shows, as a depth: each of the next passes then runs over its own pixels alone.
#include "frame.glsl"
#include "samples.glsl"
#include "floor_ray.glsl"

layout(binding = 3) uniform sampler2D floor_map_image;

out vec4 fragment;

void main()
{
    vec3 way = way_of_pixel();
    float floor_at = floor_distance(way);
    int count = bitCount(covered(ivec2(gl_FragCoord.xy), floor_at));
    vec3 world = eye.xyz + min(floor_at, 1e6) * way;
    vec2 place = floor_place(world), off = abs(place - 0.5);
    vec4 clip = shadow_matrix * vec4(world, 1.0);
    vec2 aside = abs(clip.xy / clip.w - 0.5);
    bool shaded = max(off.x, off.y) < 0.5 ? textureLod(floor_map_image, place, 0.0).g > 0.0
                                          : max(aside.x, aside.y) < 0.5 && clip.w > 0.0 && counts.w > 0.0;
    // blocks of pixels go together, so that their shadows can be averaged
    shaded = block_mean(shaded ? 1.0 : 0.0) > 0.0;
    float open = floor_at < MISSED ? shaded ? SHADED_LEVEL : FLOOR_LEVEL : SKY_LEVEL;
    fragment = vec4(0.0);
    gl_FragDepth = count == 0 ? open : count == SAMPLES ? SOLID_LEVEL : MIXED_LEVEL;
}
