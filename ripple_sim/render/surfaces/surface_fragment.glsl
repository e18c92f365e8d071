#version 430
#include "gpu/g_buffer_write.glsl"
#include "visuals/texture_mapping.glsl"
#include "surfaces/annotation.glsl"

uniform vec4 color;  // linear; w: number of the object
uniform vec4 tiling;

in vec3 normal;
in vec3 sphere;
in vec2 baked;
in vec3 mapped;

void main()
{
    vec3 shown = sqrt(painted(color.rgb, mapped, tiling));
    float ink = 0.0;
#if FIELD
    shown = field_color(sphere);
#endif
#if GRID
    ink = grid_ink(sphere);
#endif
    store(normal, sphere, shown, color.w, vec2(baked.x, 0.5 * baked.y), ink);
}
