#version 430
#include "frame.glsl"
#include "studio.glsl"
#include "shadow.glsl"
#include "shading.glsl"
#include "relief.glsl"
#include "annotation.glsl"

layout(binding = 5) uniform sampler2D image;
layout(binding = 6) uniform sampler2D scene;  // the frame without the clear bodies

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

// The frame where a ray that is bent as in water leaves the body again, blurred where the body is turbid.
vec3 seen_through(vec3 position, vec3 normal, float thickness, float turbidity)
{
    vec3 bent = refract(normalize(position - eye.xyz), normal, 0.75);
    vec4 exit = view_projection * vec4(position + thickness * size * bent, 1.0);
    vec3 shown = textureLod(scene, 0.5 + 0.5 * exit.xy / exit.w, 6.0 * turbidity).rgb;
    vec3 lamps = environment(bent, 0.1 + 0.5 * turbidity, vec3(0.0)) - environment(bent, 1.0, vec3(0.0));
    return shown + max(lamps, 0.0) * 0.3;
}

void main()
{
    vec3 n = normalize(normal);
    vec4 ripple = relief_at(sphere);
    vec3 rippled = normalize(n - ripple.xyz);
    // troughs lie deeper than their surroundings: less light finds its way in
    float open = baked.x * (1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / size));
    vec3 albedo = mix(color.rgb, texture(image, uv).rgb, color.w);
    vec3 behind = vec3(0.0);
#if CLEAR
    behind = seen_through(world, rotation * rippled, baked.y, volume.x);
#endif
    Material m = Material(albedo, base.x, base.y, base.z, base.w, volume.x, volume.y, baked.y, behind, volume.w, open);
    vec3 shown = developed(shaded(m, world, rotation * rippled, rotation * n, volume.z));
#if FIELD
    shown = field_over(shown, sphere);
#endif
#if GRID
    shown = grid_over(shown, sphere);
#endif
    fragment = vec4(shown, 1.0);
}
