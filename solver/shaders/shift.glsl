#version 430
// Add one velocity to every texel.
layout(local_size_x = 64) in;
#include "layout.glsl"
layout(std430, binding = 0) buffer Velocity { float v[]; };
uniform float shift;

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (inside(t)) v[padded_index(t)] += shift;
}
