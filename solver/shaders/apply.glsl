#version 430
// The stencil on a field, times a factor, written out or added.
layout(std430, binding = 0) readonly buffer Field { vec4 x[]; };
layout(std430, binding = 1) buffer Result { vec4 result[]; };
layout(std430, binding = 3) readonly buffer Stencil { vec4 w[]; };
#ifdef FACTOR
layout(std430, binding = 4) readonly buffer Factor { vec4 factor[]; };
#endif

void emit(int quad, vec4 here, vec4 force) {
#ifdef FACTOR
    force *= factor[quad];
#endif
#ifdef SUBTRACT
    force = -force;
#endif
#ifdef ADD
    force += result[quad];
#endif
    result[quad] = force;
}

#include "block.glsl"
