#version 430
#include "geometry_write.glsl"
#include "mapping.glsl"
#include "relief.glsl"
#include "annotation.glsl"

uniform mat3 rotation;
uniform vec4 color;  // linear; w: number of the object
uniform float size;  // of the body [m]
uniform vec4 tiling;

in vec3 normal;
in vec3 sphere;
in vec2 baked;
in vec3 mapped;

void main()
{
    vec3 n = normalize(normal);
    vec4 ripple = relief_at(sphere);
    vec3 albedo = painted(color.rgb, mapped, tiling);
    vec3 shown = sqrt(albedo);
    float ink = 0.0;
#if FIELD
    shown = field_color(sphere);
#endif
#if GRID
    ink = grid_ink(sphere);
#endif
    // troughs lie deeper than their surroundings: less light finds its way in
    float open = baked.x * (1.0 - 0.4 * smoothstep(0.0, 0.03, -ripple.w / size));
    store(rotation * normalize(n - ripple.xyz), rotation * n, shown, color.w, vec3(open, 0.5 * baked.y, ink));
}
