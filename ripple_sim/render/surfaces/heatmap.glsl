// A field of the solver in false colours.
#include "surfaces/spline.glsl"

layout(binding = HEATMAP_UNIT) uniform sampler2DArray heatmap;           // a page of charts, like a height map
layout(binding = HEATMAP_COLORS_UNIT) uniform sampler2D heatmap_colors;  // sRGB, from the least to the greatest value

uniform float heatmap_limit;  // the colours range from minus this to plus this

vec3 heatmap_color(vec2 place)
{
    float value = clamp(spline_at(heatmap, vec3(place, 0.0)).x / heatmap_limit, -1.0, 1.0);
    float last = float(textureSize(heatmap_colors, 0).x - 1);
    return texture(heatmap_colors, vec2((0.5 + (0.5 + 0.5 * value) * last) / (last + 1.0), 0.5)).rgb;
}
