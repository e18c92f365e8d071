// Soft shadow of the key light: percentage-closer filtering over a disc as wide as the penumbra.
layout(binding = 1) uniform sampler2DShadow shadow_test;
layout(binding = 2) uniform sampler2D shadow_depth;

const int SEARCH_TAPS = 10;
const int FILTER_TAPS = 20;

vec2 disc(int i, int count, float turn)
{
    float angle = 2.39996323 * float(i) + turn;
    return sqrt((float(i) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}

float key_visibility(vec3 position, vec3 normal)
{
    float facing = dot(normal, key_direction.xyz);
    vec3 p = (shadow_matrix * vec4(position + 1.5 * shadow_scale.z * normal, 1.0)).xyz;
    // depth of the receiver's own plane over the map, so that a wide filter does not see the surface itself
    vec3 n = mat3(shadow_matrix) * normal * vec3(shadow_scale.x * shadow_scale.x, shadow_scale.x * shadow_scale.x,
                                                 shadow_scale.y * shadow_scale.y);
    vec2 slope = clamp(-n.xy / (abs(n.z) > 1e-6 ? n.z : 1e-6), -4.0 * shadow_scale.x / shadow_scale.y,
                       4.0 * shadow_scale.x / shadow_scale.y);
    float turn = 6.2831853 * gradient_noise(gl_FragCoord.xy);
    float bias = 0.5 * shadow_scale.z / shadow_scale.y;
    float widest = 0.09 * shadow_scale.y * key_direction.w / shadow_scale.x;

    // loops that run zero times instead of branches: the software rasteriser executes both sides of a branch
    bool inside = facing > 0.0 && all(lessThan(abs(p.xy - 0.5), vec2(0.5)));
    float depth = 0.0, blockers = 0.0;
    int taps = inside ? SEARCH_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = widest * disc(i, SEARCH_TAPS, turn);
        float d = textureLod(shadow_depth, p.xy + offset, 0.0).r;
        float blocks = step(d, p.z + dot(slope, offset) - 2.0 * bias);
        depth += blocks * d;
        blockers += blocks;
    }
    float distance = p.z - depth / max(blockers, 1.0);
    float texel = shadow_scale.z / shadow_scale.x;
    float penumbra = clamp(distance * shadow_scale.y * key_direction.w / shadow_scale.x, 1.5 * texel, widest);
    float lit = 0.0;
    taps = blockers > 0.0 ? FILTER_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = penumbra * disc(i, FILTER_TAPS, turn);
        lit += textureLod(shadow_test, vec3(p.xy + offset, p.z + dot(slope, offset) - bias), 0.0);
    }
    lit = taps > 0 ? lit / float(FILTER_TAPS) : 1.0;
    return facing > 0.0 ? lit : 0.0;
}
