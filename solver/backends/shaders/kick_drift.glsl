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
#endif
// Software drivers read a uniform anew for every texel, so there are as few as possible.
uniform float dt;
#ifndef MAPS
uniform float decay, spring;
#endif
#if defined(PARTS) && !defined(MAPS)
uniform float span;
#elif defined(MAPS) && !defined(PARTS)
uniform float acceleration;
#elif !defined(PARTS)
uniform float push;  // span times acceleration
#endif

void main() {
    uint texel = gl_GlobalInvocationID.x;
    if (beyond(texel)) return;
    int p = address(texel);
    float here = x[p];
    float force = force_at(p, here);
#ifdef EXTRA
    force += extra[p];
#endif
#ifdef MAPS
    float decay = coefficients[FIELD + p], spring = coefficients[2 * FIELD + p], span = coefficients[3 * FIELD + p];
#endif
#ifdef PARTS
    float acceleration = accelerations[int(parts[p])];
#endif
#if defined(PARTS) || defined(MAPS)
    float push = span * acceleration;
#endif
    float velocity = decay * v[p] + (coefficients[p] * force + (push - spring * here));
    v[p] = velocity;
    h_next[p] = here + dt * velocity;
}
