#version 430
// Which pixels show solids, wholly or in part, as a depth: each of the next passes then runs over its own pixels alone.
// With LAYER which ones show an object.
#include "gpu/frame_uniforms.glsl"
#include "glsl/ray.glsl"
#include "gpu/g_buffer_read.glsl"
#include "passes/solid_samples.glsl"

out vec4 fragment;

void main()
{
    int count = bitCount(solid_samples(ivec2(gl_FragCoord.xy)));
    fragment = vec4(0.0);
#if LAYER
    gl_FragDepth = count > 0 ? LAYER_LEVEL : OPEN_LEVEL;
#else
    if (count == 0)
        discard;
    gl_FragDepth = count == SAMPLES ? SOLID_LEVEL : MIXED_LEVEL;
#endif
}
