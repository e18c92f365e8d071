#version 430
#include "frame.glsl"

in vec3 in_core;
in vec3 in_shell;
in vec3 in_normal;

in mat3 in_rotation;
in vec3 in_origin;
in vec3 in_core_size;
in vec3 in_shell_size;
in vec4 in_color;
in vec4 in_material;  // roughness, metallic, coat, geom

out vec3 world;
out vec3 normal;
flat out vec4 color;
flat out vec4 material;

void main()
{
    vec3 local = in_core * in_core_size + in_shell * in_shell_size;
    world = in_rotation * local + in_origin;
    normal = in_rotation * (in_normal / in_shell_size);
    color = in_color;
    material = in_material;
    gl_Position = view_projection * vec4(world, 1.0);
}
