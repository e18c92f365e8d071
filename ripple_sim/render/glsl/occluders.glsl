// Nearby geoms, approximated by capsules.
layout(std140, binding = OCCLUDERS_BINDING) uniform Occluders { vec4 occluders[2 * MAX_OCCLUDERS]; };  // end a, radius; end b

// Ambient visibility about a normal: the share of the hemisphere that other geoms leave free. The bits of `near` select the
// occluders that count.
float occluder_visibility(vec3 position, vec3 normal, int near)
{
    float open = 1.0;
    do {  // see light_visibility
        int i = max(findLSB(near), 0);
        vec4 a = occluders[2 * i], b = occluders[2 * i + 1];
        vec3 axis = b.xyz - a.xyz, to = a.xyz - position;
        vec3 nearest = to + axis * clamp(-dot(axis, to) / max(dot(axis, axis), 1e-12), 0.0, 1.0);
        float away = length(nearest), ratio = min(a.w / max(away, 1e-9), 1.0);
        float above = clamp((dot(normal, nearest) / max(away, 1e-9) + ratio) / (1.0 + ratio), 0.0, 1.0);
        open *= near != 0 ? 1.0 - 0.9 * ratio * ratio * above * above : 1.0;
        near &= near - 1;
    } while (near != 0);
    return open;
}
