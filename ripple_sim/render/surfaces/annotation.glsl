// What a figure shows on a target: a scalar field in colours, and the texel grid.
#include "surfaces/height_maps.glsl"

layout(binding = 12) uniform sampler2DArray field;    // padded like the height map
layout(binding = 13) uniform sampler2D field_colors;  // sRGB, from the least to the greatest value

uniform float field_limit;   // the colours reach from minus this to plus this
uniform float grid_spacing;  // [texels]
uniform float resolution;    // texels along an edge of a face

vec3 field_color(vec3 direction)
{
    float value = clamp(spline_at(field, resolution, 0.0, direction).x / field_limit, -1.0, 1.0);
    float last = float(textureSize(field_colors, 0).x - 1);
    return texture(field_colors, vec2((0.5 + (0.5 + 0.5 * value) * last) / (last + 1.0), 0.5)).rgb;
}

// Two axes of a face, and the one through its middle, of any vector; the order is that of `height_map_position`.
vec3 seen_from(float face, vec3 d)
{
    if (face < 2.0)
        return face < 1.0 ? vec3(d.y, d.z, d.x) : vec3(-d.y, d.z, -d.x);
    if (face < 4.0)
        return face < 3.0 ? vec3(-d.x, d.z, d.y) : vec3(d.x, d.z, -d.y);
    return face < 5.0 ? vec3(d.x, d.y, d.z) : vec3(d.x, -d.y, -d.z);
}

// How far the place on a face moves [texels] as the direction does.
vec2 place_change(float face, vec3 direction, vec3 change)
{
    vec3 at = seen_from(face, direction), by = seen_from(face, change);
    vec2 q = at.xy / at.z;
    return 0.63661977 * resolution * (by.xy - q * by.z) / (at.z * (1.0 + q * q));
}

// Lines of a pixel's width between blocks of texels, stronger ones along the edges of the faces.
float grid_ink(vec3 direction)
{
    vec3 where = height_map_position(direction, resolution);
    vec2 place = where.xy - 1.0;
    // places jump where two faces meet, directions do not
    vec2 pixel = abs(place_change(where.z, direction, dFdx(direction)))
               + abs(place_change(where.z, direction, dFdy(direction)));
    vec2 line = abs(fract(place / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - min(place, resolution - place) / pixel, 0.0, 1.0);
    return max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
}
