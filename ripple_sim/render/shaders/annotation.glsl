// What a figure shows on a target: a scalar field in colours, and the texel grid. Both go over the lit picture, so that
// the light cannot shift a colour away from the one in the legend.
layout(binding = 12) uniform sampler2DArray field;    // padded like the relief
layout(binding = 13) uniform sampler2D field_colors;  // sRGB, from the least to the greatest value

uniform float field_limit;   // the colours reach from minus this to plus this
uniform float grid_spacing;  // [texels]

const float full_light = 0.70;    // sRGB value from which on a colour is shown as it is
const float darkest = 0.45;

// Colour of the field, darkened where `lit`, the picture of a neutral surface, is in shadow.
vec3 field_over(vec3 lit, vec3 direction)
{
    float value = clamp(spline_at(field, direction).x / field_limit, -1.0, 1.0);
    float last = float(textureSize(field_colors, 0).x - 1);
    vec3 shown = texture(field_colors, vec2((0.5 + (0.5 + 0.5 * value) * last) / (last + 1.0), 0.5)).rgb;
    float shade = clamp(dot(lit, vec3(0.2126, 0.7152, 0.0722)) / full_light, darkest, 1.0);
    return shown * shade;
}

// Lines of a pixel's width between blocks of texels, stronger ones along the edges of the faces.
vec3 grid_over(vec3 color, vec3 direction)
{
    float resolution = float(textureSize(relief, 0).x) - 2.0;
    vec2 place = relief_position(direction, resolution).xy - 1.0;
    vec2 border = min(place, resolution - place);
    // the places jump where two faces meet; the distance to the border does not
    vec2 pixel = clamp(fwidth(border), 1e-4, grid_spacing);
    vec2 line = abs(fract(place / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - border / pixel, 0.0, 1.0);
    float ink = max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
    return mix(color, vec3(0.09, 0.11, 0.16), ink);
}
