#version 430
// The stencil on a field, times a factor, written out or added.
layout(local_size_x = 64) in;
#include "layout.glsl"
#include "force.glsl"
layout(std430, binding = 0) readonly buffer Stencil { float w[]; };
layout(std430, binding = 1) readonly buffer Field { float x[]; };
layout(std430, binding = 2) buffer Result { float result[]; };
#ifdef FACTOR
layout(std430, binding = 3) readonly buffer Factor { float factor[]; };
#endif

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    float force;
    FORCE(w, x, t, force)
#ifdef FACTOR
    force *= factor[texel_index(t)];
#endif
#ifdef SUBTRACT
    force = -force;
#endif
#ifdef ADD
    force += result[padded_index(t)];
#endif
    result[padded_index(t)] = force;
}
