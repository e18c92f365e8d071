// The nine-point stencil on a field: of the links that start in each place, east, north, north-east, and from its east
// to its north, field by field.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Field { float x[]; };
layout(std430, binding = 3) readonly buffer Stencil { float w[]; };

const int NORTH = FIELD, RISING = 2 * FIELD, FALLING = 3 * FIELD;  // begins of the fields of `w`

// Sum over the eight links of weight times difference, at an address where the field is `here`.
float force_at(int p, float here) {
    return (w[p] * (x[p + 1] - here) + w[p - 1] * (x[p - 1] - here))
        + (w[NORTH + p] * (x[p + PITCH] - here) + w[NORTH + p - PITCH] * (x[p - PITCH] - here))
        + (w[RISING + p] * (x[p + PITCH + 1] - here) + w[RISING + p - PITCH - 1] * (x[p - PITCH - 1] - here))
        + (w[FALLING + p - 1] * (x[p + PITCH - 1] - here) + w[FALLING + p - PITCH] * (x[p - PITCH + 1] - here));
}
