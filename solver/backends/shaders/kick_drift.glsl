#version 430
// v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v. The small terms are added up first:
// one rounding at the size of v.
layout(std430, binding = 0) readonly buffer Height { dvec4 x[]; };
layout(std430, binding = 1) buffer Velocity { dvec4 v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { dvec4 h_next[]; };
layout(std430, binding = 3) readonly buffer Stencil { dvec4 w[]; };
layout(std430, binding = 4) readonly buffer Coefficients { dvec4 coefficients[]; };  // gain, then decay, spring and span
#ifdef EXTRA
layout(std430, binding = 5) readonly buffer ExtraForce { dvec4 extra[]; };
#endif
#ifdef PARTS
layout(std430, binding = 6) readonly buffer Parts { dvec4 parts[]; };
layout(std430, binding = 7) readonly buffer Accelerations { float accelerations[]; };
#else
uniform float acceleration;
#endif
uniform float dt;
#ifndef MAPS
uniform float decay, spring, span;
#endif

#include "eights.glsl"

void emit(int eight, float here[8], float force[8]) {
    float velocity[8] = unpack(v[eight]), gain[8] = unpack(coefficients[eight]), drifted[8];
#ifdef EXTRA
    float more[8] = unpack(extra[eight]);
#endif
#ifdef MAPS
    float decays[8] = unpack(coefficients[eight + FIELD]), springs[8] = unpack(coefficients[eight + 2 * FIELD]);
    float spans[8] = unpack(coefficients[eight + 3 * FIELD]);
#endif
#ifdef PARTS
    float part[8] = unpack(parts[eight]);
#endif
    for (int i = 0; i < 8; i++) {
#ifdef EXTRA
        force[i] += more[i];
#endif
#ifdef MAPS
        float decay = decays[i], spring = springs[i], span = spans[i];
#endif
#ifdef PARTS
        float acceleration = accelerations[int(part[i])];
#endif
        velocity[i] = decay * velocity[i] + (gain[i] * force[i] + (span * acceleration - spring * here[i]));
        drifted[i] = here[i] + dt * velocity[i];
    }
    v[eight] = pack(velocity);
    h_next[eight] = pack(drifted);
}

#include "block.glsl"
