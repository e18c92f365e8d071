#version 430
#include "frame.glsl"
#include "studio.glsl"
#include "shadow.glsl"
#include "shading.glsl"
#include "relief.glsl"

layout(binding = 5) uniform sampler2D image;

uniform mat3 rotation;
uniform vec4 color;       // linear; w: 1 with an image on top
uniform vec4 base;        // roughness, metallic, sheen, coat
uniform vec4 volume;      // translucency, transparency, geom

in vec3 world;
in vec3 normal;
in vec3 sphere;
in vec2 baked;
in vec2 uv;

out vec4 fragment;

void main()
{
    vec3 n = normalize(normal);
    vec3 rippled = normalize(n - relief_at(sphere).xyz);
    vec3 albedo = mix(color.rgb, texture(image, uv).rgb, color.w);
    Material m = Material(albedo, base.x, base.y, base.z, base.w, volume.x, volume.y, baked.y, baked.x);
    fragment = vec4(developed(shaded(m, world, rotation * rippled, rotation * n, volume.z)), 1.0);
}
