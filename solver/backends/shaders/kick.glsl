#version 430
// Kick a list of texels, and drift them by that; every texel is named once, so no two threads meet.
layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) readonly buffer Places { int places[]; };
layout(std430, binding = 3) readonly buffer Kicks { float kicks[]; };
uniform int count;
uniform float dt;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    v[places[i]] += kicks[i];
    h[places[i]] += dt * kicks[i];
}
