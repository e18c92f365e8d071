#version 430
// Weighted sums of heights or velocities, one group of threads each; see Probes. Heights have drifted beyond velocities.
layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) readonly buffer Velocity { float v[]; };
layout(std430, binding = 2) readonly buffer Rows { int rows[]; };  // first entry, one after the last, of heights
layout(std430, binding = 3) readonly buffer Entries { ivec2 entries[]; };  // address, bits of the weight
layout(std430, binding = 4) writeonly buffer Sums { float sums[]; };
#ifdef DENT
layout(std430, binding = 5) readonly buffer Dent { float dent[]; };
#endif
uniform int first;
uniform float drifted;

shared float partial[GROUP];

void main() {
    int thread = int(gl_LocalInvocationID.x), row = int(gl_WorkGroupID.x);
    float sum = 0.0;
    for (int i = rows[3 * row] + thread; i < rows[3 * row + 1]; i += GROUP) {
        int p = entries[i].x;
        float value = v[p];
        if (rows[3 * row + 2] != 0) {
            value = h[p] - drifted * value;
#ifdef DENT
            value += dent[p];
#endif
        }
        sum += intBitsToFloat(entries[i].y) * value;
    }
    partial[thread] = sum;
    for (int half_group = GROUP / 2; half_group > 0; half_group /= 2) {
        barrier();
        if (thread < half_group) partial[thread] += partial[thread + half_group];
    }
    if (thread == 0) sums[first + row] = partial[0];
}
