#version 430
// Add velocities to a list of texels; every texel is named once, so no two threads meet.
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Velocity { float v[]; };
layout(std430, binding = 1) readonly buffer Places { int places[]; };
layout(std430, binding = 2) readonly buffer Kicks { float kicks[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) v[places[i]] += kicks[i];
}
