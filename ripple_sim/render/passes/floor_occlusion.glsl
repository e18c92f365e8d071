#version 410
// The light that reaches a point of the floor. Ambient visibility follows from the heights of the objects above the floor: the
// form factor of horizontal patches at height h and horizontal distance d is h^2 / (pi (h^2 + d^2)^2) per unit area.
#include "glsl/view.glsl"

#stage fragment
#include "glsl/lights.glsl"
#include "glsl/soft_shadows.glsl"

layout(binding = CEILING_UNIT) uniform sampler2D ceiling;  // linear colour; a: height, 0 at the floor, 1 at the top

uniform vec3 extent;  // width of the map [m], height of its top [m], radius of influence [m]

layout(location = 0) out vec4 fragment;  // see floor_map.glsl
layout(location = 1) out vec4 bounced;
layout(location = 2) out vec4 seen;

const int TAPS = 14;
const int SHADOW_TAPS = 16;
const float SIDE = 0.25;   // share of a light on a side that faces neither to it nor away from it
const float UNDER = 0.5;   // share of the floor's light on objects above it

// Shadow on a texel of the floor: whether anything shades a part of the texel, and the share of the light that passes.
struct Shade { bool any; float passes; };

// Shadow of a light on a texel of the floor; `texel` is its width [m].
Shade shade_of(int light, vec3 world, float texel)
{
    Shadow shadow = shadow_at(light);
    vec4 clip = shadow.matrix * vec4(world, 1.0), width = shadow.width;
    vec3 p = clip.xyz / clip.w;
    vec2 off = abs(p.xy - 0.5);
    float to_light = light_distance(shadow.depth, p.z), margin = texel / (width.x + width.y * to_light);
    float reach = widest_penumbra(light, to_light) + margin, closest = 1e9, widest = 0.0;
    bool inside = counts.w > float(light) && clip.w > 0.0 && max(off.x, off.y) < 0.5 + reach;
    // four texels of that level, which cover all within reach
    vec2 about = blockers_mean(light, p.xy, 2.0 * reach).xy;
    float penumbra = penumbra_of(light, about.y / max(about.x, 1e-6), to_light);
    float passes = inside ? 1.0 - blockers_mean(light, p.xy, max(penumbra, margin)).x : 1.0;
    float first = first_point();
    vec2 direction = spiral_direction(first);
#if TRANSMISSION
    int taps = inside ? SHADOW_TAPS : 0;
#else
    int taps = inside && about.x > 0.0 ? SHADOW_TAPS : 0;
#endif
    for (int i = 0; i < taps; ++i) {
        // denser in the middle: close objects cast narrow shadows
        float offset = reach * (float(i) + 0.25 * first) / float(SHADOW_TAPS);
        direction = FOURTH_TURN * direction;
        float depth = textureLod(shadow_maps, in_maps(light, p.xy + offset * direction), 0.0).r;
        closest = depth < 1.0 ? min(closest, offset) : closest;
        widest = depth < 1.0 ? max(widest, penumbra_of(light, light_distance(shadow.depth, depth), to_light)) : widest;
#if TRANSMISSION
        vec2 blocker = transparent_blocker(taken_about(light, p.xy + offset * direction, 0.0));
        closest = blocker.x > 0.0 ? min(closest, offset) : closest;
        widest = blocker.x > 0.0 ? max(widest, penumbra_of(light, blocker.y / blocker.x, to_light)) : widest;
#endif
    }
    // a closer object may lie between two points
    return Shade(closest < widest + margin + 0.2 * reach, passes);
}

void main()
{
    vec2 uv = 0.5 * screen + 0.5;
    float texel = extent.x / float(textureSize(ceiling, 0).x);
    float covered = 0.0;
    // colours of the covering objects, and the moments of the colours along the axes of the floor
    vec3 colors = vec3(0.0), across = vec3(0.0), along = vec3(0.0);
    float first = first_point();
    vec2 direction = spiral_direction(first);
    for (int i = 0; i < TAPS; ++i) {
        // radii grow with the square of the index: dense near contacts, each tap with the area that it stands for
        float s = (float(i) + 0.25 * first) / float(TAPS);
        float distance = extent.z * s * s, area = TWO_PI * distance * 2.0 * extent.z * s / float(TAPS);
        direction = FOURTH_TURN * direction;
        vec4 above = textureLod(ceiling, uv + distance * direction / extent.x, 0.0);
        float h = max(above.a * extent.y, 0.6 * texel), r2 = h * h + distance * distance;
        float share = above.a < 1.0 ? h * h * area / (3.14159265 * r2 * r2) : 0.0;
        covered += share;
        vec3 color = share * above.rgb;
        colors += color;
        across += color * direction.x;
        along += color * direction.y;
    }
    // nothing is known beyond the map
    vec2 off = abs(screen);
    float known = 1.0 - smoothstep(0.7, 1.0, max(off.x, off.y));
    covered = block_mean(covered, bvec2(true)) * known;
    colors = block_mean(colors, bvec2(true));
    across = block_mean(across, bvec2(true));
    along = block_mean(along, bvec2(true));
    vec2 local = floor_map.xy + screen * floor_map.z;
    vec3 world = floor_origin.xyz + local.x * floor_u.xyz + local.y * floor_v.xyz;
    float size = floor_map.z * dFdx(screen.x);
    bool shaded = false;
    vec3 arrives = vec3(0.0), unshaded = vec3(1e-6), bounce = vec3(0.0);
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 towards;
        vec3 radiance = incident(light_at(i), world, towards), light = radiance * max(dot(floor_normal.xyz, towards), 0.0);
        // sides of objects that a point of the floor sees face the point
        vec2 sidewards = vec2(dot(floor_u.xyz, towards), dot(floor_v.xyz, towards));
        bounce += radiance * max(SIDE * colors - across * sidewards.x - along * sidewards.y, 0.0);
        unshaded += light;
        if (i < SHADOWS) {
            Shade shade = shade_of(i, world, size);
            shaded = shaded || shade.any;
            light *= shade.passes * transmitted(i, world, floor_normal.xyz, 0.0);
        }
        arrives += light;
    }
    float share = dot(arrives, vec3(1.0)) / dot(unshaded, vec3(1.0));
    bounce += UNDER * colors * floor_albedo.rgb * (share * floor_light.rgb + sky.rgb);
    bounced = vec4(known * bounce, 1.0);
    float open = 1.0 - min(covered, 1.0);
    fragment = vec4(open, shaded ? 1.0 : 0.0, 0.0, 1.0);
    seen = vec4(open, share, 0.0, 1.0);
}
