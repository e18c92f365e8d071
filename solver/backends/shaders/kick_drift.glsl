#version 430
// v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v. The small terms are added up first:
// one rounding at the size of v.
#include "stencil.glsl"

layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { float h_next[]; };
layout(std430, binding = 4) readonly buffer Coefficients { float coefficients[]; };  // gain, then decay, spring and span
#ifdef EXTRA
layout(std430, binding = 5) readonly buffer ExtraForce { float extra[]; };
#endif
#ifdef PARTS
layout(std430, binding = 6) readonly buffer Parts { float parts[]; };
layout(std430, binding = 7) readonly buffer Accelerations { float accelerations[]; };
#else
uniform float acceleration;
#endif
uniform float dt;
#ifndef MAPS
uniform float decay, spring, span;
#endif

void main() {
    int p = address(int(gl_GlobalInvocationID.x));
    if (p < 0) return;
    float force = force_at(p);
#ifdef EXTRA
    force += extra[p];
#endif
#ifdef MAPS
    int field = x.length();
    float decay = coefficients[field + p], spring = coefficients[2 * field + p], span = coefficients[3 * field + p];
#endif
#ifdef PARTS
    float acceleration = accelerations[int(parts[p])];
#endif
    float velocity = decay * v[p] + (coefficients[p] * force + (span * acceleration - spring * x[p]));
    v[p] = velocity;
    h_next[p] = x[p] + dt * velocity;
}
