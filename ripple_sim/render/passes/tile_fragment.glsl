#version 430
// The background where it is smooth; with PLAIN interpolated from the corners of tiles.
#include "passes/coarse_background.glsl"
#include "glsl/tone_mapping.glsl"

in vec3 color;
in vec2 in_coarse;
out vec4 fragment;

void main()
{
#if PLAIN
    vec3 shown = color;
#else
    vec3 shown = textureLod(coarse, in_coarse, 0.0).rgb;
#endif
    fragment = vec4(dithered(shown), 1.0);
}
