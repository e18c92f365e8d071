#version 430
#include "gpu/g_buffer_write.glsl"
#include "visuals/texture_mapping.glsl"
#include "surfaces/heatmap.glsl"
#include "surfaces/texel_grid.glsl"
#include "surfaces/height_maps.glsl"

uniform vec4 color;  // linear; w: number of the object
uniform vec4 tiling;
uniform float resolution;  // texels along a chart's side

in vec3 normal;
in vec2 place;
flat in vec2 chart;
in vec3 baked;
in vec3 mapped;

void main()
{
    vec3 shown = sqrt(textured(color.rgb, mapped, tiling));
    // a pixel whose centre lies beside the triangle must not leave its chart
    vec2 inside = clamp(place, chart + 1.0, chart + resolution + 1.0);
    float ink = 0.0;
#if HEATMAP
    shown = heatmap_color(inside);
#endif
#if GRID
    ink = grid_ink(place, resolution);
#endif
    bool inner = !gl_FrontFacing;  // of an open surface: closed ones show their outer side alone
    write_g_buffer(inner ? -normal : normal, inside / vec2(textureSize(height_maps, 0).xy), shown,
                   pack_object(color.w, inner), vec2(inner ? baked.z : baked.x, 0.5 * baked.y), ink);
}
