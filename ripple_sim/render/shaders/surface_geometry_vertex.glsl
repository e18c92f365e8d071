#version 430
#include "frame.glsl"

in vec3 in_world;
in vec3 in_normal;
in vec3 in_sphere;
in vec2 in_baked;
in vec3 in_mapped;

out vec3 normal;
out vec3 sphere;
out vec2 baked;
out vec3 mapped;

void main()
{
    normal = in_normal;
    sphere = in_sphere;
    baked = in_baked;
    mapped = in_mapped;
    gl_Position = view_projection * vec4(in_world, 1.0);
}
