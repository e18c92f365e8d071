#version 430
// Tiles of the frame, at a given depth, with their rays.
#include "glsl/view.glsl"

in vec2 in_corner;  // the tile's lower left

uniform float level;
uniform vec2 extent;  // of a tile

void main()
{
    vec2 place = in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    set_view(place);
    gl_Position = vec4(place, 2.0 * level - 1.0, 1.0);
}
