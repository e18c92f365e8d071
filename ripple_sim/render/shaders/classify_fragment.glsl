#version 430
// Which pixels show solids, wholly or in part, as a depth: each of the next passes then runs over its own pixels alone.
#include "frame.glsl"
#include "ray.glsl"
#include "samples.glsl"

out vec4 fragment;

void main()
{
    int count = bitCount(covered(ivec2(gl_FragCoord.xy), floor_depth()));
    if (count == 0)
        discard;
    fragment = vec4(0.0);
    gl_FragDepth = count == SAMPLES ? SOLID_LEVEL : MIXED_LEVEL;
}
