// Soft shadow of the first light: percentage-closer filtering over a disc as wide as the penumbra.
layout(binding = 1) uniform sampler2DShadow shadow_test;
layout(binding = 2) uniform sampler2D shadow_map;

const int SEARCH_TAPS = 10;
const int FILTER_TAPS = 16;

// By the golden angle: points at growing radii spread evenly.
const mat2 TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);

// Distance from the lamp [m] of a depth in the map.
float lamp_distance(float depth)
{
    return (shadow_depth.x * depth + shadow_depth.y) / (shadow_depth.z * depth + shadow_depth.w);
}

// Radius of the penumbra, in the map, on what lies behind a blocker; both by their distance from the lamp [m].
float penumbra_of(float blocker, float behind)
{
    float blur = shadow_penumbra.x + shadow_penumbra.y / max(blocker, 1e-6);
    float width = shadow_width.x + shadow_width.y * behind;
    return min((behind - blocker) * blur / width, shadow_penumbra.z);
}

// Share of the first light that arrives. The normal is that of the surface at large; `lift` [m] raises the position
// above bumps that shall not shade each other.
float key_visibility(vec3 position, vec3 normal, float lift)
{
    bool far_away = NEAR_LAMPS == 0 || lights[0].position.w == 0.0;
    vec3 lamp = far_away ? lights[0].direction.xyz : normalize(lights[0].position.xyz - position);
    float facing = dot(normal, lamp);
    float away = far_away ? 0.0 : distance(lights[0].position.xyz, position);
    float texel = (shadow_width.x + shadow_width.y * away) / shadow_width.z;
    vec3 raised = position + (lift + (1.5 + 2.5 * (1.0 - facing)) * texel) * normal;
    vec4 clip = shadow_matrix * vec4(raised, 1.0);
    vec3 p = clip.xyz / clip.w;
    float to_lamp = lamp_distance(p.z), width = shadow_width.x + shadow_width.y * to_lamp;
    float stretch = shadow_depth.z * p.z + shadow_depth.w;
    float metre = stretch * stretch / (shadow_depth.x * shadow_depth.w - shadow_depth.y * shadow_depth.z);
    // depth of the receiver's own plane over the map, so that a wide filter does not see the surface itself
    vec4 plane = shadow_planes * vec4(normal, -dot(normal, raised));
    float steepest = 10.0 * width * metre;
    vec2 slope = -plane.xy * (abs(plane.z) > 1e-9 ? 1.0 / plane.z : 1e9);
    slope = clamp(slope, -steepest, steepest);
    // another noise in each exposure: a step along the diagonal turns the filter by about the golden angle
    float turn = 6.2831853 * gradient_noise(gl_FragCoord.xy + 5.588238 * counts.z);
    vec2 direction = vec2(cos(turn), sin(turn));
    float bias = 0.5 * texel * metre;
    float widest = shadow_penumbra.z;

    // loops that run zero times instead of branches: the software rasteriser executes both sides of a branch
    bool inside = counts.w > 0.0 && facing > -0.5 && clip.w > 0.0 && all(lessThan(abs(p - 0.5), vec3(0.5)));
    float depth = 0.0, blockers = 0.0;
    int taps = inside ? SEARCH_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        // denser in the middle, where a near blocker must not be missed
        vec2 offset = widest * (float(i) + 0.1) / float(SEARCH_TAPS) * direction;
        direction = TURN * direction;
        float d = textureLod(shadow_map, p.xy + offset, 0.0).r;
        float blocks = step(d, p.z + dot(slope, offset) - 2.0 * bias);
        depth += blocks * d;
        blockers += blocks;
    }
    float blocker = lamp_distance(depth / max(blockers, 1.0));
    float penumbra = max(penumbra_of(blocker, to_lamp), 1.5 / shadow_width.z);
    float lit = 0.0;
    taps = blockers > 0.0 && blockers < float(SEARCH_TAPS) ? FILTER_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = penumbra * sqrt((float(i) + 0.5) / float(FILTER_TAPS)) * direction;
        direction = TURN * direction;
        lit += textureLod(shadow_test, vec3(p.xy + offset, p.z + dot(slope, offset) - bias), 0.0);
    }
    return taps > 0 ? lit / float(FILTER_TAPS) : 1.0 - blockers / float(SEARCH_TAPS);
}
