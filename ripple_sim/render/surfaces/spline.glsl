#include "surfaces/cube_map.glsl"

// Quadratic B-spline over 3 x 3 texels, from four bilinear taps: a surface whose normals have no kinks. A halo of one
// texel is enough, and where three faces meet all three give the same value.
vec4 spline_at(sampler2DArray faces, float resolution, float first_layer, vec3 direction)
{
    float width = float(textureSize(faces, 0).x);
    vec3 position = height_map_position(direction, resolution);
    position.z += first_layer;
    vec2 texel = floor(position.xy);
    vec2 t = position.xy - texel - 0.5;
    vec2 left = 0.5 * (1.0 - t), right = 0.5 * (1.0 + t);
    vec2 low = texel - 0.5 + (0.75 - t * t) / (2.0 * left);
    vec2 high = texel + 0.5 + 0.5 * (0.5 + t) * (0.5 + t) / right;
    low /= width;
    high /= width;
    return left.y * (left.x * textureLod(faces, vec3(low.x, low.y, position.z), 0.0)
                     + right.x * textureLod(faces, vec3(high.x, low.y, position.z), 0.0))
         + right.y * (left.x * textureLod(faces, vec3(low.x, high.y, position.z), 0.0)
                      + right.x * textureLod(faces, vec3(high.x, high.y, position.z), 0.0));
}
