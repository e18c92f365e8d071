#version 430
// A field and a share of the way to another.
layout(local_size_x = GROUP) in;
layout(std430, binding = 0) writeonly buffer Texels { float texels[]; };
layout(std430, binding = 2) readonly buffer First { float first[]; };
layout(std430, binding = 3) readonly buffer Second { float second[]; };
uniform int count;
uniform float share;

#include "backends/shaders/peak.glsl"

void main() {
    int i = int(gl_GlobalInvocationID.x);
    float value = 0.0;
    if (i < count) {
        precise float step = share * (second[i] - first[i]);
        value = first[i] + step;
        texels[i] = value;
    }
    raise_peak(value);
}
