#version 430
#include "frame.glsl"

in vec3 in_core;
in vec3 in_shell;
in vec3 in_normal;
in vec2 in_uv;

in mat3 in_rotation;
in vec3 in_origin;
in vec3 in_core_size;
in vec3 in_shell_size;
in vec4 in_color;    // linear; w: number of the object
in vec4 in_mapping;  // texture coordinates a metre; or repetitions; w: 1 where the mesh brings its own

out vec3 normal;
out vec3 mapped;
flat out vec4 color;

void main()
{
    vec3 local = in_core * in_core_size + in_shell * in_shell_size;
    normal = in_rotation * (in_normal / in_shell_size);
    mapped = (in_mapping.w > 0.0 ? vec3(in_uv, 0.0) : local) * in_mapping.xyz;
#if MAPPING == 1
    mapped -= in_mapping.w > 0.0 ? vec3(0.0) : vec3(0.5);
#endif
    color = in_color;
    gl_Position = view_projection * vec4(in_rotation * local + in_origin, 1.0);
}
