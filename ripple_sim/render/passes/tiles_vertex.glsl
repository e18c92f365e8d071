#version 430
// Square tiles of the framebuffer, as instances.
#include "glsl/ray_cast.glsl"

in vec2 in_corner;  // the tile's lower left

uniform vec2 extent;

void main()
{
    cast_ray(in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1));
    gl_Position = vec4(screen, 0.0, 1.0);
}
