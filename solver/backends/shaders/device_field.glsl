#version 430
// A field's texels one after the other: of one field with halo or the sum of two; or, with BLEND, those of a field that
// lies so already and a share of the way to another.
layout(std430, binding = 0) writeonly buffer Texels { float texels[]; };
layout(std430, binding = 2) readonly buffer First { float first[]; };
layout(std430, binding = 3) readonly buffer Second { float second[]; };
#ifndef BLEND
layout(std430, binding = 4) readonly buffer Addresses { int addresses[]; };
#endif
uniform int count;
uniform float share;  // without BLEND 1: add the second; 0: leave it out

#include "backends/shaders/peak.glsl"

void main() {
    int i = int(gl_GlobalInvocationID.x);
    float value = 0.0;
    if (i < count) {
#ifdef BLEND
        precise float step = share * (second[i] - first[i]);
        value = first[i] + step;
#else
        value = first[addresses[i]];
        if (share > 0.0) value += second[addresses[i]];
#endif
        texels[i] = value;
    }
    raise_peak(value);
}
