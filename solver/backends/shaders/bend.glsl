#version 430
// The force of curvatures on each texel: its neighbours' and its own, written out or added.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Curvatures { float curvature[]; };  // three fields, with their halo
layout(std430, binding = 1) buffer Result { float result[]; };
layout(std430, binding = 2) readonly buffer Weights { float weights[]; };  // of neighbours and itself, field by field

void main() {
    int p = address(int(gl_GlobalInvocationID.x));
    if (p < 0) return;
    int steps[9] = int[9](-PITCH - 1, -PITCH, -PITCH + 1, -1, 1, PITCH - 1, PITCH, PITCH + 1, 0);
    int field = result.length();
    float force = 0.0;
    for (int kind = 0; kind < 3; kind++)
        for (int k = 0; k < 9; k++)
            force -= weights[(9 * kind + k) * field + p] * curvature[kind * field + p + steps[k]];
#ifdef ADD
    force += result[p];
#endif
    result[p] = force;
}
