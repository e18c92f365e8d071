#version 410
// Fills the frame from the coarse background, tile by tile; see `CoarseBackground`. With PLAIN pixels are interpolated from
// the corners of their tile, otherwise from the coarse background. With ROUGH pixels where the coarse background is not smooth
// are marked by their depth.
layout(binding = COARSE_BACKGROUND_UNIT) uniform sampler2D coarse;  // a: 1 for floor, 0 for sky, between them where rough

#stage vertex
#include "glsl/tiles.glsl"

uniform float level;
uniform vec2 blocks;  // blocks of the coarse background in a frame

out vec2 in_coarse;  // texture coordinates in the coarse background
out vec3 color;

void main()
{
    in_coarse = (0.5 + 0.5 * tile_corner()) * blocks / vec2(textureSize(coarse, 0));
    color = textureLod(coarse, in_coarse, 0.0).rgb;
    gl_Position = on_tile(level);
}

#stage fragment
#include "glsl/tone_mapping.glsl"

const float UNSURE = 0.002;  // weight of rough blocks from which a pixel is not interpolated

in vec2 in_coarse;
in vec3 color;
out vec4 fragment;

void main()
{
#if PLAIN
    vec4 shown = vec4(color, 1.0);
#else
    vec4 shown = textureLod(coarse, in_coarse, 0.0);
#endif
    fragment = vec4(dithered(shown.rgb), 1.0);
#if ROUGH
    // all four pixels of a block, so that they can share their search for blockers
    gl_FragDepth = block_mean(min(shown.a, 1.0 - shown.a), bvec2(true)) > UNSURE ? SHADED_LEVEL : OPEN_LEVEL;
#endif
}
