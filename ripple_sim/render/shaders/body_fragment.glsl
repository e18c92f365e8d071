#version 430
#include "frame.glsl"
#include "studio.glsl"
#include "shadow.glsl"
#include "shading.glsl"

in vec3 world;
in vec3 normal;
flat in vec4 color;
flat in vec4 material;

out vec4 fragment;

void main()
{
    vec3 n = normalize(normal);
    Material m = Material(color.rgb, material.x, material.y, 0.15, material.z, 0.0, 0.0, 1.0, vec3(0.0), 0.0, 1.0);
    fragment = vec4(developed(shaded(m, world, n, n, material.w)), color.a);
}
