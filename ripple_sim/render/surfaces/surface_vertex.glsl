#version 430
#include "gpu/frame_uniforms.glsl"

in vec4 in_moved;  // displaced, in the world [m]; w: ambient visibility that nearby geoms leave
in vec3 in_normal;
in vec3 in_sphere;
in vec2 in_baked;
in vec3 in_mapped;

uniform mat3 rotation;

out vec3 normal;
out vec3 sphere;
out vec2 baked;
out vec3 mapped;

void main()
{
    normal = rotation * in_normal;
    sphere = in_sphere;
    baked = in_baked * vec2(in_moved.w, 1.0);
    mapped = in_mapped;
    gl_Position = view_projection * vec4(in_moved.xyz, 1.0);
}
