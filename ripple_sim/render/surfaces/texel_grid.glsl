// Lines between blocks of texels.
uniform float grid_spacing;  // [texels]

// Opacity of the lines, a pixel wide; those along the borders of the charts are stronger.
float grid_ink(vec2 place, float resolution)
{
    vec2 pixel = fwidth(place);
    vec2 at = mod(place, resolution + 2.0) - 1.0;
    vec2 line = abs(fract(at / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - min(at, resolution - at) / pixel, 0.0, 1.0);
    return max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
}
