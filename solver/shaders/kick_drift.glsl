#version 430
// v = decay v + gain force - spring h + push, then h_next = h + dt v.
layout(std430, binding = 0) readonly buffer Height { vec4 x[]; };
layout(std430, binding = 1) buffer Velocity { vec4 v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { vec4 h_next[]; };
layout(std430, binding = 3) readonly buffer Stencil { vec4 w[]; };
layout(std430, binding = 4) readonly buffer Coefficients { vec4 coefficients[]; };  // gain, then decay, spring and push
#ifdef EXTRA
layout(std430, binding = 5) readonly buffer ExtraForce { vec4 extra[]; };
#endif
uniform float dt;
#ifdef MAPS
const int FIELD = 6 * (N + 2) * STRIDE / 4;
#define DECAY coefficients[quad + FIELD]
#define SPRING coefficients[quad + 2 * FIELD]
#define PUSH coefficients[quad + 3 * FIELD]
#else
uniform float decay, spring, push;
#define DECAY decay
#define SPRING spring
#define PUSH push
#endif

void emit(int quad, vec4 here, vec4 force) {
#ifdef EXTRA
    force += extra[quad];
#endif
    vec4 kicked = DECAY * v[quad] + coefficients[quad] * force - SPRING * here + PUSH;
    v[quad] = kicked;
    h_next[quad] = here + dt * kicked;
}

#include "block.glsl"
