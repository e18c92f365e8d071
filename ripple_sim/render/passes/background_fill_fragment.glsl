#version 430
// The background, interpolated from one of lower resolution; pixels where that is not smooth are marked as a depth.
#include "glsl/tone_mapping.glsl"
#include "glsl/pixel_block.glsl"

// a: 1 where the floor is smooth, 0 where the sky is, between them where neither is
layout(binding = COARSE_BACKGROUND_UNIT) uniform sampler2D coarse;

uniform vec2 span;  // of the coarse background, in frames

in vec2 screen;
out vec4 fragment;

void main()
{
    vec4 shown = textureLod(coarse, (0.5 + 0.5 * screen) / span, 0.0);
    fragment = vec4(dithered(shown.rgb), 1.0);
    // all four pixels of a block, so that their shadows can be averaged
    gl_FragDepth = block_mean(min(shown.a, 1.0 - shown.a)) > UNSURE ? SHADED_LEVEL : OPEN_LEVEL;
}
