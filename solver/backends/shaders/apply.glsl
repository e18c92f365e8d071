#version 430
// The stencil on a field, times a factor, written out or added.
layout(std430, binding = 0) readonly buffer Field { dvec4 x[]; };
layout(std430, binding = 1) buffer Result { dvec4 result[]; };
layout(std430, binding = 3) readonly buffer Stencil { dvec4 w[]; };
#ifdef FACTOR
layout(std430, binding = 4) readonly buffer Factor { dvec4 factor[]; };
#endif

#include "eights.glsl"

void emit(int eight, float here[8], float force[8]) {
#ifdef FACTOR
    float factors[8] = unpack(factor[eight]);
    for (int i = 0; i < 8; i++) force[i] *= factors[i];
#endif
#ifdef SUBTRACT
    for (int i = 0; i < 8; i++) force[i] = -force[i];
#endif
#ifdef ADD
    float sum[8] = unpack(result[eight]);
    for (int i = 0; i < 8; i++) force[i] += sum[i];
#endif
    result[eight] = pack(force);
}

#include "block.glsl"
