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
uniform vec4 volume;      // translucency, transparency, geom, highest ripple [m]
uniform float size;       // of the body [m]

in vec3 world;
in vec3 normal;
in vec3 sphere;
in vec2 baked;
in vec2 uv;

out vec4 fragment;

void main()
{
    vec3 n = normalize(normal);
    vec4 ripple = relief_at(sphere);
    vec3 rippled = normalize(n - ripple.xyz);
    // troughs lie deeper than their surroundings: less light finds its way in
    float open = baked.x * (1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / size));
    vec3 albedo = mix(color.rgb, texture(image, uv).rgb, color.w);
    Material m = Material(albedo, base.x, base.y, base.z, base.w, volume.x, volume.y, baked.y, volume.w, open);
    fragment = vec4(developed(shaded(m, world, rotation * rippled, rotation * n, volume.z)), 1.0);
}
