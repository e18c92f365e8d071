#version 430
// v = decay v + gain force - spring h + push, then h_next = h + dt v.
layout(local_size_x = 64) in;
#include "layout.glsl"
#include "force.glsl"
layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { float h_next[]; };
layout(std430, binding = 3) readonly buffer Stencil { float w[]; };
layout(std430, binding = 4) readonly buffer Coefficients { vec4 coefficients[]; };  // gain, decay, spring, push
#ifdef EXTRA
layout(std430, binding = 5) readonly buffer ExtraForce { float extra[]; };
#endif
uniform float dt;

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    int p = padded_index(t);
    vec4 k = coefficients[texel_index(t)];
    float force;
    FORCE(w, h, t, force)
#ifdef EXTRA
    force += extra[p];
#endif
    float kicked = k.y * v[p] + k.x * force - k.z * h[p] + k.w;
    v[p] = kicked;
    h_next[p] = h[p] + dt * kicked;
}
