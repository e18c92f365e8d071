#version 430
// Gershgorin's bound of the largest eigenvalue: the greatest of twice the sum of |w| over the mass. The other end of a
// link to a fixed rim does not move, and its share of that is a half.
layout(std430, binding = 0) readonly buffer Links { float links[]; };  // field by field
layout(std430, binding = 2) readonly buffer Places { int places[]; };
layout(std430, binding = 3) readonly buffer Shares { float shares[]; };
layout(std430, binding = 4) readonly buffer Beside { float beside[]; };  // sum of |w| over irregular links
layout(std430, binding = 5) readonly buffer Mass { float mass[]; };
uniform int count, width;

#include "peak.glsl"

void main() {
    int i = int(gl_GlobalInvocationID.x);
    float rate = 0.0;
    if (i < count) {
        int p = places[i], north = p + width, south = p - width;
        int field = links.length() / 4;
        int norths = field, rising = 2 * field, falling = 3 * field;
        float sum = beside[i];
        sum += abs(links[p]) * shares[p + 1] + abs(links[p - 1]) * shares[p - 1];
        sum += abs(links[norths + p]) * shares[north] + abs(links[norths + south]) * shares[south];
        sum += abs(links[rising + p]) * shares[north + 1] + abs(links[rising + south - 1]) * shares[south - 1];
        sum += abs(links[falling + p - 1]) * shares[north - 1] + abs(links[falling + south]) * shares[south + 1];
        rate = 2.0 * sum / mass[i];
    }
    raise_peak(rate);
}
