// What the geometry pass leaves of the visible surfaces, sample by sample; the light is reckoned from it afterwards.

// Direction of a vector as a point of the unit square: an octahedron, unfolded.
vec2 folded(vec3 n)
{
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 outer = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return 0.5 + 0.5 * (n.z < 0.0 ? outer : n.xy);
}

vec3 unfolded(vec2 code)
{
    vec2 p = 2.0 * code - 1.0;
    float z = 1.0 - abs(p.x) - abs(p.y), under = max(-z, 0.0);
    return normalize(vec3(p.x - (p.x < 0.0 ? -under : under), p.y - (p.y < 0.0 ? -under : under), z));
}

// Two shares of one in a channel of 16 bits.
float joined(float high, float low)
{
    return dot(floor(255.0 * clamp(vec2(high, low), 0.0, 1.0) + 0.5), vec2(256.0, 1.0)) / 65535.0;
}

vec2 parted(float channel)
{
    float bits = floor(65535.0 * channel + 0.5), high = floor(bits / 256.0);
    return vec2(high, bits - 256.0 * high) / 255.0;
}
