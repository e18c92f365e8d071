#version 430
// Hand the part of the elastic height that is beyond the yield height over to the permanent one.
#include "charts.glsl"

layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Dent { float dent[]; };
layout(std430, binding = 2) readonly buffer YieldHeight { float limit[]; };

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    float kept = clamp(h[p], -limit[p], limit[p]);
    dent[p] += h[p] - kept;
    h[p] = kept;
}
