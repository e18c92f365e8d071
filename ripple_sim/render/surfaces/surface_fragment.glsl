#version 430
#include "gpu/g_buffer_write.glsl"
#include "visuals/texture_mapping.glsl"
#include "surfaces/heatmap.glsl"
#include "surfaces/texel_grid.glsl"

uniform vec4 color;  // linear; w: number of the object
uniform vec4 tiling;
uniform float resolution;  // texels along an edge of a face

in vec3 normal;
in vec3 sphere;
in vec2 baked;
in vec3 mapped;

void main()
{
    vec3 shown = sqrt(textured(color.rgb, mapped, tiling));
    float ink = 0.0;
#if HEATMAP
    shown = heatmap_color(sphere, resolution);
#endif
#if GRID
    ink = grid_ink(sphere, resolution);
#endif
    write_g_buffer(normal, sphere, shown, color.w, vec2(baked.x, 0.5 * baked.y), ink);
}
