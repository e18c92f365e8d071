#version 410
// Classifies pixels by what they show, as a depth, so that each of the next passes runs over its own pixels only: whether
// all or some of the samples show solids; with LAYER, whether any shows the object.
#include "glsl/view.glsl"

#stage fragment
#include "glsl/g_buffer_samples.glsl"

out vec4 fragment;

void main()
{
    int count = bitCount(visible_samples(ivec2(gl_FragCoord.xy)));
    fragment = vec4(0.0);
#if LAYER
    gl_FragDepth = count > 0 ? LAYER_LEVEL : OPEN_LEVEL;
#else
    if (count == 0)
        discard;
    gl_FragDepth = count == SAMPLES ? SOLID_LEVEL : MIXED_LEVEL;
#endif
}
