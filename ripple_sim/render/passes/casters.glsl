#version 410
// Objects as a light or the floor sees them; MAP is the kind of the map (see contract.py, soft_shadows.glsl). With MOVED
// the vertices are displaced vertices of a target, and TEXELS tells which texels of its texture are drawn.
#include "glsl/frame.glsl"

VARYING vec3 albedo;
#if MOVED
VARYING vec3 world;
#if TEXELS != ALL_TEXELS
VARYING vec3 mapped;
#endif
#endif

#stage vertex
uniform mat4 matrix;

#if MOVED
in vec4 in_moved;
#if TEXELS != ALL_TEXELS
in vec3 in_mapped;
#endif

uniform vec3 color;  // linear

void main()
{
    albedo = color;
    world = in_moved.xyz;
#if TEXELS != ALL_TEXELS
    mapped = in_mapped;
#endif
    gl_Position = matrix * vec4(world, 1.0);
}
#else
in vec3 in_core;
in vec3 in_shell;
in mat3 in_rotation;
in vec3 in_origin;
in vec3 in_core_size;
in vec3 in_shell_size;
in vec4 in_color;  // linear; number in the table of objects

void main()
{
    albedo = in_color.rgb;
    vec3 local = in_core * in_core_size + in_shell * in_shell_size;
    gl_Position = matrix * vec4(in_rotation * local + in_origin, 1.0);
}
#endif

#stage fragment
#if TEXELS != ALL_TEXELS
#include "glsl/texture_mapping.glsl"
#include "glsl/opacity.glsl"

uniform vec4 tiling;

// Opacity of the texel; discards a texel that is not drawn.
float drawn_opacity()
{
    float opacity = texel_opacity(mapped.xy * tiling.xy + tiling.zw);
    if (!is_drawn(opacity))
        discard;
    return opacity;
}
#else
float drawn_opacity()
{
    return 1.0;
}
#endif

#if MAP == TRANSMISSION_MAP
uniform int light;
uniform vec3 transmission;  // share of the light that passes a refracting surface which it meets head on

#if MOVED
const float FOCUS = 3.0;       // brightness of the light that meets the object head on, on the floor by its foot
const float BRIGHTEST = 0.95;  // greatest mean of the colours; less than 1, so that the map contains the distance as well
#endif

out vec4 fragment;

void main()
{
    vec3 passes = transmission;
#if TEXELS == CLEAR_TEXELS
    passes = mix(vec3(1.0), transmission, drawn_opacity());
#elif MOVED
    drawn_opacity();
    vec4 place = lights[light].position;
    vec3 towards = place.w == 0.0 ? lights[light].direction.xyz : normalize(place.xyz - world);
    vec3 normal = cross(dFdx(world), dFdy(world));
    float cosine = abs(dot(towards, normal)) / max(length(normal), 1e-30), aside = 1.0 - cosine;
#if SOLID
    // a round body is a lens: its shadow is dark towards the rim and has a focus in the middle (caustics)
    passes *= FOCUS * pow(cosine, 10.0);
    passes *= min(BRIGHTEST / max(dot(passes, vec3(1.0 / 3.0)), 1e-6), 1.0);
#else
    passes *= 1.0 - aside * aside;  // the rest is reflected
#endif
#endif
    vec3 taken = 1.0 - passes;
    fragment = vec4(taken, dot(taken, vec3(1.0 / 3.0)) * light_distance(shadows[light].depth, gl_FragCoord.z));
}
#elif MAP == ALBEDO_MAP
out vec4 fragment;

void main()
{
    drawn_opacity();
    fragment = vec4(albedo, gl_FragCoord.z);
}
#else
void main()
{
    drawn_opacity();
}
#endif
