// What the geometry pass leaves of the visible surfaces, sample by sample; the light is reckoned from it afterwards.

// Unit vector as a point of the unit square: an octahedron, unfolded.
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
