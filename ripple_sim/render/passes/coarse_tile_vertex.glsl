#version 430
// Tiles of the frame, at a given depth, with the background's colours at their corners.
#include "passes/coarse_background.glsl"

in vec2 in_corner;  // the tile's lower left

uniform float level;
uniform vec2 extent;  // of a tile
uniform vec2 blocks;  // of the background in a frame

out vec2 in_coarse;  // texture coordinates in the coarse background
out vec3 color;

void main()
{
    vec2 place = in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    in_coarse = (0.5 + 0.5 * place) * blocks / vec2(textureSize(coarse, 0));
    color = textureLod(coarse, in_coarse, 0.0).rgb;
    gl_Position = vec4(place, 2.0 * level - 1.0, 1.0);
}
