#version 430
// Weights of the six links of the quads whose south-west corners are at the places. The law is in cells.py. The
// rest is like the kernel `quad_pass`, with the same names.
layout(std430, binding = 0) readonly buffer Places { double places[]; };
layout(std430, binding = 1) readonly buffer Conductance { float conductance[]; };
layout(std430, binding = 2) readonly buffer PerArea { float per_area[]; };
layout(std430, binding = 3) readonly buffer Detours { float detours[]; };  // east, north, rising, falling
layout(std430, binding = 4) writeonly buffer Sides { float sides[]; };  // south, north, west, east, rising, falling
uniform int count, width;
uniform float scale, power;

float cross_length(vec3 a, vec3 b) { return length(cross(a, b)); }

float hourglass(float pp, float qq, float pq, float area) {
    float both_sides = max(0.5 * (pp + qq), TINY);
    float a = 0.5 * (both_sides + abs(pq)), d = 0.25 * (pp - qq);
    float in_time = both_sides * area / (2.0 * (area * area + 3.0 * d * d));
    float unhurried = (a * a - d * d) / (4.0 * a * area);
    float of_square = 2.0 * area / (PER_HOURGLASS * both_sides);
    return min(PER_TINY * (pp + qq), 1.0) * min(in_time, max(MAX_HOURGLASS_SHARE * unhurried, of_square));
}

float quad_area(vec3 e, vec3 n, vec3 p) {
    float rising = cross_length(e, p) + cross_length(p, n);
    float falling = cross_length(e, n) + cross_length(p - e, n - e);
    return 0.5 * min(rising, falling);
}

void quad(vec3 e, vec3 n, vec3 p, float detours[6], out float links[6]) {
    vec3 q = n - e, north = p - n, east = p - e, way = north - e;
    float pp = dot(p, p), qq = dot(q, q), pq = dot(p, q), flat_area = cross_length(p, q);
    float to_south = detours[0] * dot(e, e), to_north = detours[1] * dot(north, north);
    float to_west = detours[2] * dot(n, n), to_east = detours[3] * dot(east, east);
    float to_pp = detours[4] * pp, to_qq = detours[5] * qq, to_pq = 0.5 * (to_west + to_east - to_south - to_north);
    float limit = (pp + to_pp) * (qq + to_qq), new_pq = pq + to_pq;
    float fit = clamp((limit - new_pq * new_pq) / (DETOUR_FADE * max(limit, TINY)), 0.0, 1.0);
    to_pp *= fit;
    to_qq *= fit;
    to_pq *= fit;
    float square = max(flat_area * flat_area + (to_pp * (qq + to_qq) + pp * to_qq - to_pq * (pq + pq + to_pq)), 0.0);
    pp += to_pp;
    qq += to_qq;
    pq += to_pq;
    float along_p = dot(way, p) + 0.5 * fit * (to_east + to_north - to_south - to_west);
    float along_q = dot(way, q) + 0.5 * fit * (to_east + to_south - to_north - to_west);
    float twice = max(2.0 * max(sqrt(square), 0.5 * MIN_AREA * (pp + qq)), TINY);
    square = 0.25 * twice * twice;
    float a = (along_p * qq - along_q * pq) / square, b = (along_q * pp - along_p * pq) / square;
    float uneven = EVENNESS * (a * a + b * b), share = uneven / (uneven + 1.0);
    a = clamp(share * a, -1.0, 1.0);
    b = clamp(share * b, -1.0, 1.0);
    float skew = pq / twice, h = hourglass(pp, qq, pq, 0.25 * twice);
    links = float[6](
        skew + h * (1.0 + a) * (1.0 - b), skew + h * (1.0 - a) * (1.0 + b),
        h * (1.0 + a) * (1.0 + b) - skew, h * (1.0 - a) * (1.0 - b) - skew,
        qq / twice - h * (1.0 - a * a), pp / twice - h * (1.0 - b * b)
    );
}

vec3 between(int a, int b) {
    dvec3 from = dvec3(places[a], places[count + a], places[2 * count + a]);
    return vec3(scale * (dvec3(places[b], places[count + b], places[2 * count + b]) - from));
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    float links[6] = float[6](0.0, 0.0, 0.0, 0.0, 0.0, 0.0), factor = 0.0;
    if (conductance[i] > 0.0) {
        vec3 e = between(i, i + 1), n = between(i, i + width), p = between(i, i + width + 1);
        int rising = 2 * count + i, falling = 3 * count + i;
        float longer[6] = float[6](
            detours[i], detours[i + width], detours[count + i], detours[count + i + 1], detours[rising], detours[falling]
        );
        quad(e, n, p, longer, links);
        float ratio = max(quad_area(e, n, p) * per_area[i], MIN_AREA_RATIO);
        factor = power == -1.0 ? conductance[i] / ratio : conductance[i] * pow(ratio, power);
    }
    for (int k = 0; k < 6; k++) sides[k * count + i] = factor * links[k];
}
