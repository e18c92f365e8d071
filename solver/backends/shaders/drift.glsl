#version 430
// v += shift where texels are movable, then h += dt v.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) buffer Height { dvec4 h[]; };
layout(std430, binding = 1) buffer Velocity { dvec4 v[]; };
layout(std430, binding = 2) readonly buffer Movable { dvec4 movable[]; };
uniform float shift;
uniform float dt;

#include "eights.glsl"

void main() {
    uint eight = gl_GlobalInvocationID.x;
    if (eight >= h.length()) return;
    float height[8] = unpack(h[eight]), velocity[8] = unpack(v[eight]), moves[8] = unpack(movable[eight]);
    for (int i = 0; i < 8; i++) {
        velocity[i] += shift * moves[i];
        height[i] += dt * velocity[i];
    }
    v[eight] = pack(velocity);
    h[eight] = pack(height);
}
