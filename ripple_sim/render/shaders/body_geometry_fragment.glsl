#version 430
#include "geometry_write.glsl"

in vec3 normal;
in vec3 mapped;
flat in vec4 color;  // linear; w: number of the object

#if MAPPING == 2
layout(binding = 6) uniform samplerCube image;
#else
layout(binding = 5) uniform sampler2D image;
#endif

void main()
{
    vec3 albedo = color.rgb;
#if MAPPING == 1
    albedo *= texture(image, mapped.xy).rgb;
#elif MAPPING == 2
    albedo *= texture(image, mapped).rgb;
#endif
    vec3 n = normalize(normal);
    store(n, n, sqrt(albedo), color.w, vec3(1.0, 1.0, 0.0));
}
