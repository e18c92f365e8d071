#version 410
// A target into the G-buffer, with its texture; with HEATMAP one of the solver's fields in false colours, with GRID lines
// between blocks of texels, with GLOW an image of the light that it emits. TEXELS tells which texels of a flat texture with opacity are drawn.
uniform float resolution;  // texels along a chart's side

VARYING vec3 normal;
VARYING vec2 place;
flat VARYING vec2 chart;  // where its halo begins on the page
VARYING vec3 baked;  // ambient visibility outside, thickness, ambient visibility inside
VARYING vec3 mapped;

#stage vertex
#include "glsl/frame.glsl"

in vec4 in_moved;  // displaced, in the world [m]; w: ambient visibility that nearby geoms leave
in vec3 in_normal;
in vec2 in_place;  // on the page of charts [texels]
in vec3 in_baked;
in vec3 in_mapped;

uniform mat3 rotation;

void main()
{
    normal = rotation * in_normal;
    place = in_place;
    chart = floor(in_place / (resolution + 2.0)) * (resolution + 2.0);
    baked = in_baked * vec3(in_moved.w, 1.0, in_moved.w);
    mapped = in_mapped;
    gl_Position = view_projection * vec4(in_moved.xyz, 1.0);
}

#stage fragment
#include "glsl/g_buffer.glsl"
#include "glsl/height_maps.glsl"
#include "glsl/texture_mapping.glsl"
#if TEXELS != ALL_TEXELS
#include "glsl/opacity.glsl"
#endif

uniform vec4 color;  // linear; w: number of the object
uniform vec4 tiling;

layout(location = 0) out vec4 g_normal;
layout(location = 1) out vec4 g_color;

#if GLOW
layout(binding = GLOW_IMAGE_UNIT) uniform sampler2D glow_image;
#endif

#if HEATMAP
layout(binding = HEATMAP_UNIT) uniform sampler2DArray heatmap;           // a page of charts, like a height map
layout(binding = HEATMAP_COLORS_UNIT) uniform sampler2D heatmap_colors;  // sRGB, from the least to the greatest value

uniform float heatmap_limit;  // the colours range from minus this to plus this

vec3 heatmap_color(vec2 place)
{
    float value = clamp(spline_at(heatmap, vec3(place, 0.0)).x / heatmap_limit, -1.0, 1.0);
    float last = float(textureSize(heatmap_colors, 0).x - 1);
    return texture(heatmap_colors, vec2((0.5 + (0.5 + 0.5 * value) * last) / (last + 1.0), 0.5)).rgb;
}
#endif

#if GRID
uniform float grid_spacing;  // [texels]

// Opacity of the lines, a pixel wide; lines along the borders of the charts are stronger.
float grid_ink(vec2 place, float resolution)
{
    vec2 pixel = fwidth(place);
    vec2 at = mod(place, resolution + 2.0) - 1.0;
    vec2 line = abs(fract(at / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - min(at, resolution - at) / pixel, 0.0, 1.0);
    return max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
}
#endif

void main()
{
#if TEXELS != ALL_TEXELS
    float opacity = texel_opacity(mapped.xy * tiling.xy + tiling.zw);
    if (!is_drawn(opacity))
        discard;
#endif
    vec3 reflected = textured(color.rgb, mapped, tiling), emitted = vec3(0.0);
#if GLOW
    emitted = texture(glow_image, mapped.xy * tiling.xy + tiling.zw).rgb;
    reflected = min(reflected, 1.0 - emitted);
#endif
    vec3 shown = sqrt(reflected + emitted);
    // a pixel whose centre lies beside the triangle must not leave its chart
    vec2 inside = clamp(place, chart + 1.0, chart + resolution + 1.0);
    float ink = 0.0;
#if HEATMAP
    shown = heatmap_color(inside);
#endif
#if GRID
    ink = grid_ink(place, resolution);
#endif
#if TEXELS == CLEAR_TEXELS
    ink = opacity;
#elif GLOW
    ink = dot(emitted, vec3(1.0)) / max(dot(reflected + emitted, vec3(1.0)), 1e-6);
#endif
    bool inner = !gl_FrontFacing;  // of an open surface: closed ones show their outer side alone
    encode_surface(inner ? -normal : normal, inside / vec2(textureSize(height_maps, 0).xy), shown,
                   pack_object(color.w, inner), vec2(inner ? baked.z : baked.x, 0.5 * baked.y), ink, g_normal, g_color);
}
