#version 430
// The force of curvatures on each texel: its neighbours' and its own, written out or added.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Curvatures { float curvature[]; };  // three fields, with their halo
layout(std430, binding = 1) buffer Result { float result[]; };
layout(std430, binding = 2) readonly buffer Weights { float weights[]; };  // of neighbours and itself, field by field

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    int steps[9] = int[9](-PITCH - 1, -PITCH, -PITCH + 1, -1, 1, PITCH - 1, PITCH, PITCH + 1, 0);
    float force = 0.0;
    for (int kind = 0; kind < 3; kind++)
        for (int k = 0; k < 9; k++)
            force -= weights[(9 * kind + k) * FIELD + p] * curvature[kind * FIELD + p + steps[k]];
#ifdef ADD
    force += result[p];
#endif
    result[p] = force;
}
