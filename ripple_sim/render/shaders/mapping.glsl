// The picture on an object: none, a flat one (MAPPING 1) or a cube's (MAPPING 2).
#if MAPPING == 2
layout(binding = 6) uniform samplerCube image;
#else
layout(binding = 5) uniform sampler2D image;
#endif

vec3 painted(vec3 albedo, vec3 mapped)
{
#if MAPPING == 1
    albedo *= texture(image, mapped.xy).rgb;
#elif MAPPING == 2
    albedo *= texture(image, mapped).rgb;
#endif
    return albedo;
}
