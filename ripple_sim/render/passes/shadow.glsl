// Soft shadows of the first lights: percentage-closer filtering over a disc as wide as the penumbra. SHADOWS is how many
// there may be; their maps lie side by side.
layout(binding = 1) uniform sampler2DShadow shadow_test;
layout(binding = 2) uniform sampler2D shadow_map;

const int SEARCH_TAPS = 10;
const int FILTER_TAPS = 16;

// By the golden angle: points at growing radii spread evenly.
const mat2 TURN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);

// Where a point of a lamp's map lies in the picture of all maps.
vec2 in_maps(int lamp, vec2 point)
{
#if SHADOWS > 1
    float edge = 0.5 / shadows[lamp].width.z;  // a neighbour's texels shall not be mixed in
    point.x = (clamp(point.x, edge, 1.0 - edge) + float(lamp)) / float(SHADOWS);
#endif
    return point;
}

// Distance from a lamp [m] of a depth in its map.
float lamp_distance(int lamp, float depth)
{
    vec4 d = shadows[lamp].depth;
    return (d.x * depth + d.y) / (d.z * depth + d.w);
}

// Radius of the penumbra, in the map, on what lies behind a blocker; both by their distance from the lamp [m].
float penumbra_of(int lamp, float blocker, float behind)
{
    vec4 penumbra = shadows[lamp].penumbra, width = shadows[lamp].width;
    float blur = penumbra.x + penumbra.y / max(blocker, 1e-6);
    return min((behind - blocker) * blur / (width.x + width.y * behind), penumbra.z);
}

// Share of a light that arrives. The normal is that of the surface at large; `lift` [m] raises the position
// above bumps that shall not shade each other.
float visibility(int lamp, vec3 position, vec3 normal, float lift)
{
    vec4 place = lights[lamp].position, of_depth = shadows[lamp].depth, of_width = shadows[lamp].width;
    bool far_away = NEAR_LAMPS == 0 || place.w == 0.0;
    vec3 towards = far_away ? lights[lamp].direction.xyz : normalize(place.xyz - position);
    float facing = dot(normal, towards);
    float away = far_away ? 0.0 : distance(place.xyz, position);
    float texel = (of_width.x + of_width.y * away) / of_width.z;
    vec3 raised = position + (lift + (1.5 + 2.5 * (1.0 - facing)) * texel) * normal;
    vec4 clip = shadows[lamp].matrix * vec4(raised, 1.0);
    vec3 p = clip.xyz / clip.w;
    float to_lamp = lamp_distance(lamp, p.z), width = of_width.x + of_width.y * to_lamp;
    float stretch = of_depth.z * p.z + of_depth.w;
    float metre = stretch * stretch / (of_depth.x * of_depth.w - of_depth.y * of_depth.z);
    // depth of the receiver's own plane over the map, so that a wide filter does not see the surface itself
    vec4 plane = shadows[lamp].planes * vec4(normal, -dot(normal, raised));
    float steepest = 10.0 * width * metre;
    vec2 slope = -plane.xy * (abs(plane.z) > 1e-9 ? 1.0 / plane.z : 1e9);
    slope = clamp(slope, -steepest, steepest);
    // another noise in each exposure: a step along the diagonal turns the filter by about the golden angle
    float turn = 6.2831853 * gradient_noise(gl_FragCoord.xy + 5.588238 * counts.z);
    vec2 direction = vec2(cos(turn), sin(turn));
    float bias = 0.5 * texel * metre;
    float widest = shadows[lamp].penumbra.z;

    // loops that run zero times instead of branches: the software rasteriser executes both sides of a branch
    bool inside = counts.w > float(lamp) && facing > -0.5 && clip.w > 0.0 && all(lessThan(abs(p - 0.5), vec3(0.5)));
    float depth = 0.0, blockers = 0.0;
    int taps = inside ? SEARCH_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        // denser in the middle, where a near blocker must not be missed
        vec2 offset = widest * (float(i) + 0.1) / float(SEARCH_TAPS) * direction;
        direction = TURN * direction;
        float d = textureLod(shadow_map, in_maps(lamp, p.xy + offset), 0.0).r;
        float blocks = step(d, p.z + dot(slope, offset) - 2.0 * bias);
        depth += blocks * d;
        blockers += blocks;
    }
    float blocker = lamp_distance(lamp, depth / max(blockers, 1.0));
    float penumbra = max(penumbra_of(lamp, blocker, to_lamp), 1.5 / of_width.z);
    float lit = 0.0;
    taps = blockers > 0.0 ? FILTER_TAPS : 0;
    for (int i = 0; i < taps; ++i) {
        vec2 offset = penumbra * sqrt((float(i) + 0.5) / float(FILTER_TAPS)) * direction;
        direction = TURN * direction;
        lit += textureLod(shadow_test, vec3(in_maps(lamp, p.xy + offset), p.z + dot(slope, offset) - bias), 0.0);
    }
    return taps > 0 ? lit / float(FILTER_TAPS) : 1.0;
}
