#version 430
#include "frame.glsl"

uniform float reach;

out vec2 plane;

void main()
{
    plane = reach * vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID >> 1) * 2 - 1);
    gl_Position = view_projection * vec4(floor_origin.xyz + plane.x * floor_u.xyz + plane.y * floor_v.xyz, 1.0);
}
