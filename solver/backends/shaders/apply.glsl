#version 430
// The stencil on a field, times a factor, written out or added.
#include "stencil.glsl"

layout(std430, binding = 1) buffer Result { float result[]; };
#ifdef FACTOR
layout(std430, binding = 4) readonly buffer Factor { float factor[]; };
#endif

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    float force = force_at(p, x[p]);
#ifdef FACTOR
    force *= factor[p];
#endif
#ifdef SUBTRACT
    force = -force;
#endif
#ifdef ADD
    force += result[p];
#endif
    result[p] = force;
}
