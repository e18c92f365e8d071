#version 430
// v += shift where waves are carried, then h += dt v.
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Height { vec4 h[]; };
layout(std430, binding = 1) buffer Velocity { vec4 v[]; };
layout(std430, binding = 2) readonly buffer Carries { vec4 carries[]; };
uniform float shift;
uniform float dt;

void main() {
    uint quad = gl_GlobalInvocationID.x;
    if (quad >= h.length()) return;
    vec4 shifted = v[quad] + shift * carries[quad];
    v[quad] = shifted;
    h[quad] += dt * shifted;
}
