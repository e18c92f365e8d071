#version 430
// Raise the crests to the size of the height, with its permanent part; bits as in peak.glsl.
#include "charts.glsl"

layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) buffer Crests { float crests[]; };
#ifdef DENT
layout(std430, binding = 2) readonly buffer Dent { float dent[]; };
#endif

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    float height = h[p];
#ifdef DENT
    height += dent[p];
#endif
    crests[p] = uintBitsToFloat(max(floatBitsToUint(crests[p]), floatBitsToUint(abs(height))));
}
