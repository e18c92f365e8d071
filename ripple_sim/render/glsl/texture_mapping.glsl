// The texture on an object. MAPPING is one of the kinds in contract.py. A shape that a flat texture is wrapped round has half
// sizes of 1.
#if MAPPING == CUBE_IMAGE
layout(binding = CUBE_IMAGE_UNIT) uniform samplerCube cube_image;
#else
layout(binding = FLAT_IMAGE_UNIT) uniform sampler2D image;
#endif

#if MAPPING > CUBE_IMAGE
const float TURNS = 0.15915494;  // in a radian

// Texture coordinates u, v (from the upper edge) at a point, and their derivatives along x, y and z.
vec2 wrapped(vec3 p, out mat3x2 slope)
{
    vec3 side = abs(p);
    float radius = max(length(p.xy), 1e-6);
    float u = fract(TURNS * atan(p.y, p.x)), v = 0.5 - 0.5 * p.z;
    vec3 along_u = TURNS / (radius * radius) * vec3(-p.y, p.x, 0.0), along_v = vec3(0.0, 0.0, -0.5);
#if MAPPING == BOX_IMAGE
    // projected along the axes
    bool x = side.x > max(side.y, side.z), y = !x && side.y > side.z;
    slope = x ? mat3x2(0.0, 0.0, 0.5, 0.0, 0.0, -0.5) : y ? mat3x2(0.5, 0.0, 0.0, 0.0, 0.0, -0.5)
                                                          : mat3x2(0.5, 0.0, 0.0, -0.5, 0.0, 0.0);
    return 0.5 + slope * p;
#elif MAPPING == CYLINDER_IMAGE
    if (side.z > radius) {
        slope = mat3x2(0.5, 0.0, 0.0, 0.5, 0.0, 0.0);
        return 0.5 + slope * p;
    }
#else
    // v is proportional to the elevation above the equator; a capsule's ends are hemispheres on the discs at -1 and 1
    const bool ball = MAPPING == BALL_IMAGE;
    float up = ball ? 1.0 : sign(p.z), equator = ball ? 0.5 : 0.5 + 0.5 * up, z = ball ? p.z : side.z - 1.0;
    float rate = (ball ? -2.0 : -4.0) * TURNS * up;
    bool curved = ball || z > 0.0;
    v = curved ? equator + rate * atan(z, radius) : v;
    along_v = curved ? rate / (radius * radius + z * z) * vec3(-z * p.xy / radius, up * radius) : along_v;
#endif
    slope = mat3x2(along_u.x, along_v.x, along_u.y, along_v.y, along_u.z, along_v.z);
    return vec2(u, v);
}
#endif

// Albedo under a texture; `tiling` scales and shifts the coordinates of a flat one.
vec3 textured(vec3 albedo, vec3 mapped, vec4 tiling)
{
#if MAPPING == FLAT_IMAGE
    albedo *= texture(image, mapped.xy * tiling.xy + tiling.zw).rgb;
#elif MAPPING == CUBE_IMAGE
    albedo *= texture(cube_image, mapped).rgb;
#elif MAPPING > CUBE_IMAGE
    // coordinates jump from one edge of the texture to the other: differences of the coordinates would blur the seam
    mat3x2 slope;
    vec2 place = wrapped(mapped, slope) * tiling.xy + tiling.zw;
    albedo *= textureGrad(image, place, tiling.xy * (slope * dFdx(mapped)), tiling.xy * (slope * dFdy(mapped))).rgb;
#endif
    return albedo;
}
