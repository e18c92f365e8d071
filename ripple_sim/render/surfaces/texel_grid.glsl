// Lines between blocks of texels.
#include "surfaces/cube_map.glsl"

uniform float grid_spacing;  // [texels]

// Opacity of the lines, a pixel wide; those along the edges of the faces are stronger.
float grid_ink(vec3 direction, float resolution)
{
    vec3 where = height_map_position(direction, resolution);
    vec2 place = where.xy - 1.0;
    // positions jump from face to face, directions do not
    vec2 pixel = abs(position_change(where.z, direction, dFdx(direction), resolution))
               + abs(position_change(where.z, direction, dFdy(direction), resolution));
    vec2 line = abs(fract(place / grid_spacing + 0.5) - 0.5) * grid_spacing;
    vec2 thin = clamp(1.1 - line / pixel, 0.0, 1.0) * smoothstep(0.5, 0.2, pixel / grid_spacing);
    vec2 thick = clamp(1.6 - min(place, resolution - place) / pixel, 0.0, 1.0);
    return max(0.42 * max(thin.x, thin.y), 0.8 * max(thick.x, thick.y));
}
