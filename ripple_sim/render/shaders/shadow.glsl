// Soft shadow of the key light: percentage-closer filtering over a disc as wide as the penumbra.
layout(binding = 1) uniform sampler2DShadow shadow_test;
layout(binding = 2) uniform sampler2D shadow_depth;

const int SEARCH_TAPS = 12;
const int FILTER_TAPS = 32;

// By the golden angle: points at growing radii spread evenly.
const mat2 TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);

// The normal is that of the surface at large; `lift` [m] raises the position above bumps that shall not shade each other.
float key_visibility(vec3 position, vec3 normal, float lift)
{
    float facing = dot(normal, key_direction.xyz);
    vec3 p = (shadow_matrix * vec4(position + (lift + (1.5 + 2.5 * (1.0 - facing)) * shadow_scale.z) * normal, 1.0)).xyz;
    // depth of the receiver's own plane over the map, so that a wide filter does not see the surface itself
    vec3 n = mat3(shadow_matrix) * normal * vec3(shadow_scale.x * shadow_scale.x, shadow_scale.x * shadow_scale.x,
                                                 shadow_scale.y * shadow_scale.y);
    float steepest = 10.0 * shadow_scale.x / shadow_scale.y;
    vec2 slope = clamp(-n.xy / min(n.z, -1e-6), -steepest, steepest);
    float turn = 6.2831853 * gradient_noise(gl_FragCoord.xy);
    vec2 direction = vec2(cos(turn), sin(turn));
    float bias = 0.5 * shadow_scale.z / shadow_scale.y;
    float widest = 0.11 * shadow_scale.y * key_direction.w / shadow_scale.x;

    // loops that run zero times instead of branches: the software rasteriser executes both sides of a branch
    bool inside = facing > -0.5 && all(lessThan(abs(p.xy - 0.5), vec2(0.5)));
    float depth = 0.0, blockers = 0.0;
    int taps = inside ? SEARCH_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        // denser in the middle, where a near blocker must not be missed
        vec2 offset = widest * (float(i) + 0.1) / float(SEARCH_TAPS) * direction;
        direction = TURN * direction;
        float d = textureLod(shadow_depth, p.xy + offset, 0.0).r;
        float blocks = step(d, p.z + dot(slope, offset) - 2.0 * bias);
        depth += blocks * d;
        blockers += blocks;
    }
    float distance = p.z - depth / max(blockers, 1.0);
    float texel = shadow_scale.z / shadow_scale.x;
    float penumbra = clamp(distance * shadow_scale.y * key_direction.w / shadow_scale.x, 1.5 * texel, widest);
    float lit = 0.0;
    taps = blockers > 0.0 && blockers < float(SEARCH_TAPS) ? FILTER_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = penumbra * sqrt((float(i) + 0.5) / float(FILTER_TAPS)) * direction;
        direction = TURN * direction;
        lit += textureLod(shadow_test, vec3(p.xy + offset, p.z + dot(slope, offset) - bias), 0.0);
    }
    lit = taps > 0 ? lit / float(FILTER_TAPS) : 1.0 - blockers / float(SEARCH_TAPS);
    return lit;
}
