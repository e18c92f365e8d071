#version 430
#include "gpu/frame_uniforms.glsl"

in vec3 in_core;
in vec3 in_shell;
in vec3 in_normal;
in vec2 in_uv;

in mat3 in_rotation;
in vec3 in_origin;
in vec3 in_core_size;
in vec3 in_shell_size;
in vec4 in_color;    // linear; w: number of the object
in vec4 in_mapping;  // texture coordinates a metre; w: and along z outside the core
in vec4 in_tiling;   // scale and offset of the position in a flat texture

out vec3 normal;
out vec3 mapped;
flat out vec4 color;
flat out vec4 tiling;

void main()
{
    vec3 core = in_core * in_core_size, shell = in_shell * in_shell_size;
    normal = in_rotation * (in_normal / in_shell_size);
#if OWN
    mapped = vec3(in_uv, 0.0);
#else
    mapped = core * in_mapping.xyz + shell * in_mapping.xyw;
#endif
    color = in_color;
    tiling = in_tiling;
    gl_Position = view_projection * vec4(in_rotation * (core + shell) + in_origin, 1.0);
}
