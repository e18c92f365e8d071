#version 410
// Classifies pixels by their contents, as a depth, so that each of the next passes runs over its own pixels only: pixels with
// solids in all or in some of the samples; with LAYER, pixels with the object in any sample.
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
