// The height maps of all targets: gradient (xyz) and height (w) on six faces each with a ring of neighbour texels.
layout(binding = 0) uniform sampler2DArray height_map;

// Face and position, in texels of the padded face, that a direction from the cube's centre meets.
vec3 height_map_position(vec3 d, float resolution)
{
    vec3 size = abs(d);
    float face, u, v, main;
    if (size.x >= size.y && size.x >= size.z) {
        face = d.x < 0.0 ? 1.0 : 0.0;
        main = size.x;
        u = d.x < 0.0 ? -d.y : d.y;
        v = d.z;
    } else if (size.y >= size.z) {
        face = d.y < 0.0 ? 3.0 : 2.0;
        main = size.y;
        u = d.y < 0.0 ? d.x : -d.x;
        v = d.z;
    } else {
        face = d.z < 0.0 ? 5.0 : 4.0;
        main = size.z;
        u = d.x;
        v = d.z < 0.0 ? -d.y : d.y;
    }
    vec2 angle = atan(vec2(u, v) / main) * 1.27323954;
    return vec3((angle + 1.0) * 0.5 * resolution + 1.0, face);
}

// Quadratic B-spline over 3 x 3 texels, from four bilinear taps: a surface whose normals have no kinks. It needs one
// ring of neighbours, and where three faces meet all three give the same value.
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
