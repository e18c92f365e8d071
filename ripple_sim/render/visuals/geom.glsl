#version 410
// Geoms and sites of one shape into the G-buffer, as instances.
VARYING vec3 normal;
VARYING vec3 mapped;
flat VARYING vec4 color;  // linear; w: number of the object
flat VARYING vec4 tiling;

#stage vertex
#include "glsl/frame.glsl"

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

#stage fragment
#include "glsl/g_buffer.glsl"
#include "glsl/texture_mapping.glsl"

layout(location = 0) out vec4 g_normal;
layout(location = 1) out vec4 g_color;

void main()
{
    vec3 albedo = textured(color.rgb, mapped, tiling);
    bool inner = !gl_FrontFacing;  // of planes alone: closed geoms show only their outer side
    encode_surface(inner ? -normal : normal, vec2(0.0), sqrt(albedo), pack_object(color.w, inner), vec2(1.0), 0.0, g_normal,
                   g_color);
}
