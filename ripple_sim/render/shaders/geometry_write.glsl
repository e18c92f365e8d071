#include "geometry.glsl"

layout(location = 0) out vec4 normals;  // with ripples, and of the surface at large
layout(location = 1) out vec4 paint;    // square root of the albedo; number of the object
layout(location = 2) out vec4 details;  // openness, half the thickness, ink of lines on top, spread of the normals in the pixel

void store(vec3 rippled, vec3 normal, vec3 color, float object, vec3 baked)
{
    vec3 dx = dFdx(rippled), dy = dFdy(rippled);
    normals = vec4(folded(rippled), folded(normal));
    paint = vec4(color, object / 65535.0);
    details = vec4(baked, sqrt(min(0.5 * (dot(dx, dx) + dot(dy, dy)), 0.2) * 5.0));
}
