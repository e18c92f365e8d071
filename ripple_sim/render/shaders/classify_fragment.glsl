#version 430
// What a pixel shows, as a depth: each of the next passes then runs over its own pixels alone.
#include "frame.glsl"
#include "samples.glsl"
#include "floor_ray.glsl"

out vec4 fragment;

void main()
{
    float floor_at = floor_distance(way_of_pixel());
    int count = bitCount(covered(ivec2(gl_FragCoord.xy), floor_at));
    float open = floor_at < MISSED ? FLOOR_LEVEL : SKY_LEVEL;
    fragment = vec4(0.0);
    gl_FragDepth = count == 0 ? open : count == SAMPLES ? SOLID_LEVEL : MIXED_LEVEL;
}
