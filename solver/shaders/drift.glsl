#version 430
// v += shift where waves are carried, then h += dt v.
layout(local_size_x = 64) in;
#include "layout.glsl"
layout(std430, binding = 0) buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) readonly buffer Carries { float carries[]; };
uniform float shift;
uniform float dt;

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (!inside(t)) return;
    int i = padded_index(t);
    v[i] += shift * carries[texel_index(t)];
    h[i] += dt * v[i];
}
