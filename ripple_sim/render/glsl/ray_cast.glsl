// Rays from the eye through the frame. What varies linearly over the frame is computed at the corners of what is drawn.
#include "gpu/frame_uniforms.glsl"

out vec2 screen;          // position in the frame, from -1 to 1
out vec3 way;             // along the ray, one metre along the camera's axis
out vec3 way_local;       // the same along the floor's axes, and down to it
flat out vec3 eye_local;  // along the floor's axes from its origin, and up; below it where there is no floor
flat out vec4 limits;     // half sizes of the floor, near and far plane [m]

vec3 along_floor(vec3 v)
{
    return vec3(dot(v, floor_u.xyz), dot(v, floor_v.xyz), dot(v, floor_normal.xyz));
}

void cast_ray(vec2 place)
{
    screen = place;
    way = ray.xyz + place.x * ray_right.xyz + place.y * ray_up.xyz;
    way_local = along_floor(way) * vec3(1.0, 1.0, -1.0);
    eye_local = along_floor(eye.xyz - floor_origin.xyz);
    eye_local.z = floor_origin.w > 0.0 ? eye_local.z : -1.0;
    limits = vec4(floor_u.w, floor_v.w, ray.w, ray_right.w);
}
