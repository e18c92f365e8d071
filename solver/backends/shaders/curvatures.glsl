#version 430
// The three curvatures of each texel: sums over its neighbours of weight times difference.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) writeonly buffer Curvatures { float curvature[]; };  // three fields
layout(std430, binding = 2) readonly buffer Weights { float weights[]; };  // of eight neighbours in each, field by field

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    int steps[8] = int[8](-PITCH - 1, -PITCH, -PITCH + 1, -1, 1, PITCH - 1, PITCH, PITCH + 1);
    float here = h[p];
    for (int kind = 0; kind < 3; kind++) {
        float sum = 0.0;
        for (int k = 0; k < 8; k++) sum += weights[(8 * kind + k) * FIELD + p] * (h[p + steps[k]] - here);
        curvature[kind * FIELD + p] = sum;
    }
}
