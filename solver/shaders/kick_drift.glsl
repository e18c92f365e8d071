#version 430
// v = decay v + gain force - spring h, then h_next = h + dt v.
layout(local_size_x = 64) in;
#include "layout.glsl"
#include "force.glsl"
layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { float h_next[]; };
layout(std430, binding = 3) readonly buffer Stencil { float w[]; };
layout(std430, binding = 4) readonly buffer Gain { float gain[]; };
uniform float dt;
#ifdef DECAY_FIELD
layout(std430, binding = 5) readonly buffer Decay { float decay[]; };
#define DECAY(i) decay[i]
#else
uniform float decay;
#define DECAY(i) decay
#endif
#ifdef SPRING_FIELD
layout(std430, binding = 6) readonly buffer Spring { float spring[]; };
#define SPRING(i) spring[i]
#else
uniform float spring;
#define SPRING(i) spring
#endif
#ifdef VISCOUS
layout(std430, binding = 7) readonly buffer ViscousForce { float viscous[]; };
#endif

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    int k = texel_index(t);
    int p = padded_index(t);
    float force;
    FORCE(w, h, t, force)
#ifdef VISCOUS
    force += viscous[k];
#endif
    float kicked = DECAY(k) * v[p] + gain[k] * force - SPRING(k) * h[p];
    v[p] = kicked;
    h_next[p] = h[p] + dt * kicked;
}
