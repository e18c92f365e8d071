#version 430
// v += shift as texels respond to it, then h += dt v.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) buffer Height { dvec4 h[]; };
layout(std430, binding = 1) buffer Velocity { dvec4 v[]; };
layout(std430, binding = 2) readonly buffer Response { dvec4 response[]; };
#ifdef PARTS
layout(std430, binding = 3) readonly buffer Parts { dvec4 parts[]; };
layout(std430, binding = 4) readonly buffer Shifts { float shifts[]; };
#else
uniform float shift;
#endif
uniform float dt;

#include "eights.glsl"

void main() {
    uint eight = gl_GlobalInvocationID.x;
    if (eight >= h.length()) return;
    float height[8] = unpack(h[eight]), velocity[8] = unpack(v[eight]), moves[8] = unpack(response[eight]);
#ifdef PARTS
    float part[8] = unpack(parts[eight]);
#endif
    for (int i = 0; i < 8; i++) {
#ifdef PARTS
        float shift = shifts[int(part[i])];
#endif
        velocity[i] += shift * moves[i];
        height[i] += dt * velocity[i];
    }
    v[eight] = pack(velocity);
    h[eight] = pack(height);
}
