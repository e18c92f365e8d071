#version 430
// Weights of the six links of the quads whose south-west corners are at the places: quad_pass.py, line by line.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) readonly buffer Places { double places[]; };
layout(std430, binding = 1) readonly buffer Conductance { float conductance[]; };
layout(std430, binding = 2) readonly buffer PerArea { float per_area[]; };
layout(std430, binding = 3) writeonly buffer Sides { float sides[]; };  // south, north, west, east, rising, falling
uniform int count, width;
uniform float scale, power;

const float SLIGHTEST = 1e-12;

vec3 between(int a, int b) {
    return vec3(
        scale * (places[b] - places[a]),
        scale * (places[count + b] - places[count + a]),
        scale * (places[2 * count + b] - places[2 * count + a])
    );
}

float hourglass(float pp, float qq, float pq, float area) {
    float both_sides = max((pp + qq) * 0.5, SLIGHTEST);
    float a = (both_sides + abs(pq)) * 0.5, d = (pp - qq) * 0.25;
    float in_time = both_sides * area / (2.0 * (area * area + 3.0 * d * d));
    float unhurried = (a * a - d * d) / (4.0 * a * area);
    return min(in_time, max(SHARE * unhurried, HOURGLASS * 2.0 * area / both_sides));
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    float rest = conductance[i];
    if (rest <= 0.0) {
        for (int k = 0; k < 6; k++) sides[k * count + i] = 0.0;
        return;
    }
    vec3 e = between(i, i + 1), n = between(i, i + width), p = between(i, i + width + 1), q = n - e;
    float pp = dot(p, p), qq = dot(q, q), pq = dot(p, q);
    float twice = max(2.0 * max(length(cross(p, q)), 0.5 * LEAST_AREA * (pp + qq)), SLIGHTEST);
    float half_area = 0.5 * twice, square = half_area * half_area;
    vec3 way = p - e - n;
    float along_p = dot(way, p), along_q = dot(way, q);
    float a = (along_p * qq - along_q * pq) / square, b = (along_q * pp - along_p * pq) / square;
    float uneven = a * a + b * b, share = uneven / (uneven + UNEVEN);
    a = clamp(share * a, -1.0, 1.0);
    b = clamp(share * b, -1.0, 1.0);
    float h = hourglass(pp, qq, pq, 0.5 * half_area), skew = pq / twice;
    float rising = length(cross(e, p)) + length(cross(p, n));
    float falling = length(cross(e, n)) + length(cross(p - e, q));
    float ratio = max(min(rising, falling) * 0.5 * per_area[i], LEAST_RATIO);
    float factor = power == -1.0 ? rest / ratio : rest * pow(ratio, power);
    sides[i] = factor * (skew + h * (1.0 + a) * (1.0 - b));
    sides[count + i] = factor * (skew + h * (1.0 - a) * (1.0 + b));
    sides[2 * count + i] = factor * (h * (1.0 + a) * (1.0 + b) - skew);
    sides[3 * count + i] = factor * (h * (1.0 - a) * (1.0 - b) - skew);
    sides[4 * count + i] = factor * (qq / twice - h * (1.0 - a * a));
    sides[5 * count + i] = factor * (pp / twice - h * (1.0 - b * b));
}
