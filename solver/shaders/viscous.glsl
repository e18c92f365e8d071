#version 430
// Viscous force: the viscous stencil on the velocity.
layout(local_size_x = 64) in;
#include "layout.glsl"
#include "force.glsl"
layout(std430, binding = 0) readonly buffer Velocity { float v[]; };
layout(std430, binding = 1) readonly buffer Stencil { float w[]; };
layout(std430, binding = 2) writeonly buffer Force { float force[]; };

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    float sum;
    FORCE(w, v, t, sum)
    force[texel_index(t)] = sum;
}
