#version 430
// One triangle over the whole target, at a given depth, and what is the same all over the floor.
#include "frame.glsl"
#include "studio.glsl"

uniform float level;

out vec2 screen;
flat out vec3 around;

void main()
{
    screen = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    around = ambient(floor_normal.xyz, vec3(0.0));
    gl_Position = vec4(screen, 2.0 * level - 1.0, 1.0);
}
