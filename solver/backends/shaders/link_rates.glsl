#version 430
// Gershgorin's bound of the largest eigenvalue: the greatest of twice the sum of |w| over the mass. The other end of a
// link to a fixed rim does not move, and its share of that is a half.
layout(std430, binding = 0) readonly buffer Links { vec4 links[]; };
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
        float sum = beside[i];
        sum += abs(links[p].x) * shares[p + 1] + abs(links[p - 1].x) * shares[p - 1];
        sum += abs(links[p].y) * shares[north] + abs(links[south].y) * shares[south];
        sum += abs(links[p].z) * shares[north + 1] + abs(links[south - 1].z) * shares[south - 1];
        sum += abs(links[p - 1].w) * shares[north - 1] + abs(links[south].w) * shares[south + 1];
        rate = 2.0 * sum / mass[i];
    }
    raise_peak(rate);
}
