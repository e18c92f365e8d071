// What a figure shows on a target: a scalar field in colours, and the texel grid.
layout(binding = 12) uniform sampler2DArray field;    // padded like the relief
layout(binding = 13) uniform sampler2D field_colors;  // sRGB, from the least to the greatest value

uniform float field_limit;   // the colours reach from minus this to plus this
uniform float grid_spacing;  // [texels]

vec3 field_color(vec3 direction)
{
    float value = clamp(spline_at(field, direction).x / field_limit, -1.0, 1.0);
    float last = float(textureSize(field_colors, 0).x - 1);
    return texture(field_colors, vec2((0.5 + (0.5 + 0.5 * value) * last) / (last + 1.0), 0.5)).rgb;
}

// Lines of a pixel's width between blocks of texels, stronger ones along the edges of the faces.
float grid_ink(vec3 direction)
{
    float resolution = float(textureSize(relief, 0).x) - 2.0;
    vec2 place = relief_position(direction, resolution).xy - 1.0;
    vec2 border = min(place, resolution - place);
    // the places jump where two faces meet; the distance to the border does not
    vec2 pixel = clamp(fwidth(border), 1e-4, grid_spacing);
    vec2 line = abs(fract(place / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - border / pixel, 0.0, 1.0);
    return max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
}
