// The nine-point stencil on a field: of the links that start in each place, east, north, north-east, and from its east
// to its north.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Field { float x[]; };
layout(std430, binding = 3) readonly buffer Stencil { vec4 w[]; };

// Sum over the eight links of weight times difference, at an address.
float force_at(int p) {
    vec4 start = w[p], west = w[p - 1], south = w[p - PITCH], south_west = w[p - PITCH - 1];
    float here = x[p];
    return (start.x * (x[p + 1] - here) + west.x * (x[p - 1] - here))
        + (start.y * (x[p + PITCH] - here) + south.y * (x[p - PITCH] - here))
        + (start.z * (x[p + PITCH + 1] - here) + south_west.z * (x[p - PITCH - 1] - here))
        + (west.w * (x[p + PITCH - 1] - here) + south.w * (x[p - PITCH + 1] - here));
}
