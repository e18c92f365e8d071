#version 430
// Hand the part of the elastic height that is beyond the yield height over to the permanent one.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) buffer Height { dvec4 h[]; };
layout(std430, binding = 1) buffer Dent { dvec4 dent[]; };
layout(std430, binding = 2) readonly buffer YieldHeight { dvec4 limit[]; };

#include "eights.glsl"

void main() {
    uint eight = gl_GlobalInvocationID.x;
    if (eight >= h.length()) return;
    float height[8] = unpack(h[eight]), stays[8] = unpack(dent[eight]), most[8] = unpack(limit[eight]);
    for (int i = 0; i < 8; i++) {
        float kept = clamp(height[i], -most[i], most[i]);
        stays[i] += height[i] - kept;
        height[i] = kept;
    }
    dent[eight] = pack(stays);
    h[eight] = pack(height);
}
