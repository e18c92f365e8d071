#version 430
// The pressure on each part of the surface: what the load asks for, and the sums of its chunks.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) readonly buffer Loaded { float loaded[]; };
layout(std430, binding = 1) readonly buffer Sums { float sums[]; };
layout(std430, binding = 2) readonly buffer Begins { int begins[]; };
layout(std430, binding = 3) writeonly buffer Amplitudes { float amplitudes[]; };
uniform int count;

void main() {
    int part = int(gl_GlobalInvocationID.x);
    if (part >= count) return;
    float total = loaded[part];
    for (int i = begins[part]; i < begins[part + 1]; i++) total += sums[i];
    amplitudes[part] = total;
}
