// The pixel's ray, from ray_cast.glsl, and where it meets the plane of the floor.
in vec2 screen;
in vec3 way;
in vec3 way_local;
flat in vec3 eye_local;

// Negative where the ray meets the floor's upper side; varies linearly across the edges.
float beside_floor()
{
    vec2 beside = abs(way_local.z * eye_local.xy + eye_local.z * way_local.xy) - way_local.z * vec2(floor_u.w, floor_v.w);
    return max(max(beside.x, beside.y), 1e-6 * eye_local.z - way_local.z);
}

bool meets_floor()
{
    return floor_origin.w > 0.0 && eye_local.z > 0.0 && beside_floor() < 0.0;
}

// How far along `way` the floor's plane lies.
float floor_distance()
{
    return min(eye_local.z / max(way_local.z, 1e-9), 1e6);
}

// Distance along the camera's axis of a depth in the buffer.
float eye_distance(float depth)
{
    return ray.w * ray_right.w / (ray_right.w - depth * (ray_right.w - ray.w));
}

// Depth of the floor in the buffer; 1 where the ray misses it.
float floor_depth()
{
    float met = (ray_right.w - ray.w * ray_right.w * way_local.z / eye_local.z) / (ray_right.w - ray.w);
    return meets_floor() ? met : 1.0;
}
