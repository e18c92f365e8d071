#version 430
#include "gpu/frame_uniforms.glsl"

in vec4 in_moved;  // displaced, in the world [m]; w: ambient visibility that nearby geoms leave
in vec3 in_normal;
in vec2 in_place;  // on the page of charts [texels]
in vec3 in_baked;
in vec3 in_mapped;

uniform mat3 rotation;
uniform float resolution;  // texels along a chart's side

out vec3 normal;
out vec2 place;
flat out vec2 chart;  // where its halo begins on the page
out vec3 baked;  // ambient visibility outside, thickness, ambient visibility inside
out vec3 mapped;

void main()
{
    normal = rotation * in_normal;
    place = in_place;
    chart = floor(in_place / (resolution + 2.0)) * (resolution + 2.0);
    baked = in_baked * vec3(in_moved.w, 1.0, in_moved.w);
    mapped = in_mapped;
    gl_Position = view_projection * vec4(in_moved.xyz, 1.0);
}
