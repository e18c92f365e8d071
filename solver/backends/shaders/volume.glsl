#version 430
// The pressure on each part of the surface: what the load asks for, and sums of factor times field over the chunks of a
// list. First the sums, one group of threads a chunk; then, with PARTS, what they add up to.
#ifdef PARTS
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
#else
layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) readonly buffer Velocity { float v[]; };
layout(std430, binding = 2) readonly buffer Addresses { int addresses[]; };
layout(std430, binding = 3) readonly buffer Factors { vec2 factors[]; };  // of height and velocity
layout(std430, binding = 4) readonly buffer Chunks { ivec2 chunks[]; };  // first entry, one after the last
layout(std430, binding = 5) writeonly buffer Sums { float sums[]; };

shared float partial[GROUP];

void main() {
    int thread = int(gl_LocalInvocationID.x);
    ivec2 chunk = chunks[gl_WorkGroupID.x];
    float sum = 0.0;
    for (int i = chunk.x + thread; i < chunk.y; i += GROUP)
        sum += factors[i].x * h[addresses[i]] + factors[i].y * v[addresses[i]];
    partial[thread] = sum;
    for (int half_group = GROUP / 2; half_group > 0; half_group /= 2) {
        barrier();
        if (thread < half_group) partial[thread] += partial[thread + half_group];
    }
    if (thread == 0) sums[gl_WorkGroupID.x] = partial[0];
}
#endif
