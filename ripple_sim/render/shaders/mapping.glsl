// The picture on an object. MAPPING, as in materials.py: 0 none, 1 flat, 2 a cube's, or a flat one that is wrapped
// round a box (3), a ball (4), a cylinder (5) or a capsule (6) of half size 1.
#if MAPPING == 2
layout(binding = 6) uniform samplerCube image;
#else
layout(binding = 5) uniform sampler2D image;
#endif

#if MAPPING > 2
const float ONE_TURN = 0.15915494;  // over a turn's radians

// The picture's place u, v (from its upper edge) at a point, and how it changes along x, y and z.
vec2 wrapped(vec3 p, out mat3x2 slope)
{
    vec3 side = abs(p);
#if MAPPING == 3
    // the faces are seen along the axes
    bool x = side.x > max(side.y, side.z), y = !x && side.y > side.z;
    slope = x ? mat3x2(0.0, 0.0, 0.5, 0.0, 0.0, -0.5) : y ? mat3x2(0.5, 0.0, 0.0, 0.0, 0.0, -0.5)
                                                          : mat3x2(0.5, 0.0, 0.0, -0.5, 0.0, 0.0);
    return 0.5 + slope * p;
#else
    float radius = max(length(p.xy), 1e-6);
#if MAPPING == 5
    if (side.z > radius) {
        slope = mat3x2(0.5, 0.0, 0.0, 0.5, 0.0, 0.0);
        return 0.5 + slope * p;
    }
#endif
    vec3 around = ONE_TURN / (radius * radius) * vec3(-p.y, p.x, 0.0);
    float u = fract(ONE_TURN * atan(p.y, p.x));
    // a capsule's ends are half balls on the discs at -1 and 1
    float up = MAPPING == 6 ? sign(p.z) : 1.0, z = MAPPING == 6 ? max(side.z - 1.0, 0.0) : p.z;
    vec3 along = vec3(-z * p.xy / radius, up * radius) / (radius * radius + z * z);
    float elevation = atan(z, radius), quarters = MAPPING == 6 ? 4.0 * up * ONE_TURN : 2.0 * ONE_TURN;
    bool straight = MAPPING == 5 || MAPPING == 6 && side.z < 1.0;
    vec3 down = straight ? vec3(0.0, 0.0, -0.5) : -quarters * along;
    float v = straight ? 0.5 - 0.5 * p.z : (MAPPING == 6 ? 0.5 + 0.5 * up : 0.5) - quarters * elevation;
    slope = mat3x2(around.x, down.x, around.y, down.y, around.z, down.z);
    return vec2(u, v);
#endif
}
#endif

// Colour where a picture lies on it; `tiling` scales and shifts the place in a flat one.
vec3 painted(vec3 albedo, vec3 mapped, vec4 tiling)
{
#if MAPPING == 1
    albedo *= texture(image, mapped.xy * tiling.xy + tiling.zw).rgb;
#elif MAPPING == 2
    albedo *= texture(image, mapped).rgb;
#elif MAPPING > 2
    // the place jumps from one edge of the picture to the other: its own differences would blur it there
    mat3x2 slope;
    vec2 place = wrapped(mapped, slope) * tiling.xy + tiling.zw;
    albedo *= textureGrad(image, place, tiling.xy * (slope * dFdx(mapped)), tiling.xy * (slope * dFdy(mapped))).rgb;
#endif
    return albedo;
}
