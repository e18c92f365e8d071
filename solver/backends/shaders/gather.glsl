#version 430
// The texels of a field, or of the sum of two, one after the other.
layout(local_size_x = GROUP) in;
layout(std430, binding = 0) writeonly buffer Texels { float texels[]; };
layout(std430, binding = 2) readonly buffer Addresses { int addresses[]; };
layout(std430, binding = 3) readonly buffer First { float first[]; };
layout(std430, binding = 4) readonly buffer Second { float second[]; };
uniform int count;
uniform float share;  // 1: add the second; 0: leave it out

#include "backends/shaders/peak.glsl"

void main() {
    int i = int(gl_GlobalInvocationID.x);
    float value = 0.0;
    if (i < count) {
        value = first[addresses[i]];
        if (share > 0.0) value += second[addresses[i]];
        texels[i] = value;
    }
    raise_peak(value);
}
