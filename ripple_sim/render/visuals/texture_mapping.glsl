// The picture on an object. MAPPING, as in mapping.py: 0 none, 1 flat, 2 a cube's, or a flat one that is wrapped
// round a box (3), a ball (4), a cylinder (5) or a capsule (6) of half size 1.
#if MAPPING == 2
layout(binding = 6) uniform samplerCube image;
#else
layout(binding = 5) uniform sampler2D image;
#endif

#if MAPPING > 2
const float TURNS = 0.15915494;  // in a radian

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
    float u = fract(TURNS * atan(p.y, p.x)), v = 0.5 - 0.5 * p.z;
    vec3 along_u = TURNS / (radius * radius) * vec3(-p.y, p.x, 0.0), along_v = vec3(0.0, 0.0, -0.5);
#if MAPPING == 5
    if (side.z > radius) {
        slope = mat3x2(0.5, 0.0, 0.0, 0.5, 0.0, 0.0);
        return 0.5 + slope * p;
    }
#else
#if MAPPING == 4
    const float up = 1.0, equator = 0.5, rate = -2.0 * TURNS;
    float z = p.z;
#else
    // a capsule's ends are half balls on the discs at -1 and 1
    float up = sign(p.z), equator = 0.5 + 0.5 * up, rate = -4.0 * TURNS * up;
    float z = side.z - 1.0;
#endif
    // v goes with the elevation over the equator
    bool curved = MAPPING == 4 || z > 0.0;
    v = curved ? equator + rate * atan(z, radius) : v;
    along_v = curved ? rate / (radius * radius + z * z) * vec3(-z * p.xy / radius, up * radius) : along_v;
#endif
    slope = mat3x2(along_u.x, along_v.x, along_u.y, along_v.y, along_u.z, along_v.z);
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
