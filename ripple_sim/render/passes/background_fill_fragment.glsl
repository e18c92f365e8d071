#version 430
// The background, interpolated from one of lower resolution; pixels where that is not smooth are marked as a depth.
#include "glsl/tone_mapping.glsl"
#include "glsl/pixel_block.glsl"
#include "passes/coarse_background.glsl"

const float UNSURE = 0.002;  // weight of a block that is not smooth from which a pixel is left out

in vec2 in_coarse;
out vec4 fragment;

void main()
{
    vec4 shown = textureLod(coarse, in_coarse, 0.0);
    fragment = vec4(dithered(shown.rgb), 1.0);
    // all four pixels of a block, so that they can share their search for what shades them
    gl_FragDepth = block_mean(min(shown.a, 1.0 - shown.a)) > UNSURE ? SHADED_LEVEL : OPEN_LEVEL;
}
