#version 430
// What something transparent takes from a light, into a transmission map; see transmission.glsl.
#include "gpu/frame_uniforms.glsl"
#include "passes/light_distance.glsl"

uniform int light;
uniform vec3 transmission;  // share of the light that passes, where it meets a refracting surface head on

#if REFRACTING
const float FOCUS = 3.0;       // of light that meets it head on, on the floor by its foot
const float BRIGHTEST = 0.95;  // mean of the colours; less than 1, so that the map holds the distance as well

in vec3 world;

// Cosine of the angle at which light meets the surface.
float facing()
{
    vec4 place = lights[light].position;
    vec3 towards = place.w == 0.0 ? lights[light].direction.xyz : normalize(place.xyz - world);
    vec3 normal = cross(dFdx(world), dFdy(world));
    return abs(dot(towards, normal)) / max(length(normal), 1e-30);
}
#endif

out vec4 fragment;

void main()
{
    vec3 passes = transmission;
#if REFRACTING
    float cosine = facing(), aside = 1.0 - cosine;
#if SOLID
    // a round body is a lens: its shadow is dark towards the rim and has a focus in the middle (caustics)
    passes *= FOCUS * pow(cosine, 10.0);
    passes *= min(BRIGHTEST / max(dot(passes, vec3(1.0 / 3.0)), 1e-6), 1.0);
#else
    passes *= 1.0 - aside * aside;  // which is reflected
#endif
#endif
    vec3 taken = 1.0 - passes;
    fragment = vec4(taken, dot(taken, vec3(1.0 / 3.0)) * light_distance(shadows[light].depth, gl_FragCoord.z));
}
