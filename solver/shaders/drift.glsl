#version 430
// h += dt v
layout(local_size_x = 64) in;
#include "layout.glsl"
layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) readonly buffer Velocity { float v[]; };
uniform float dt;

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    int i = padded_index(t);
    h[i] += dt * v[i];
}
