// The pixel's ray, from ray_cast.glsl, and where it meets the plane of the floor.
in vec2 screen;
in vec3 way;
in vec3 way_local;
flat in vec3 eye_local;
flat in vec4 limits;

// Negative where the ray meets the floor's plane between two of the floor's edges; varies linearly across them.
vec2 beside_edges()
{
    return abs(way_local.z * eye_local.xy + eye_local.z * way_local.xy) - way_local.z * limits.xy;
}

// Negative where the ray meets the floor's upper side; varies linearly across the edges.
float beside_floor()
{
    vec2 beside = beside_edges();
    return max(max(beside.x, beside.y), 1e-6 * eye_local.z - way_local.z);
}

bool meets_floor()
{
    return eye_local.z > 0.0 && beside_floor() < 0.0;
}

// How far along `way` the floor's plane lies.
float floor_distance()
{
    return min(eye_local.z / max(way_local.z, 1e-9), 1e6);
}

// Distance along the camera's axis of a depth in the buffer.
float eye_distance(float depth)
{
    return limits.z * limits.w / (limits.w - depth * (limits.w - limits.z));
}

// Depth of the floor in the buffer; 1 where the ray misses it.
float floor_depth()
{
    float met = (limits.w - limits.z * limits.w * way_local.z / eye_local.z) / (limits.w - limits.z);
    return meets_floor() ? met : 1.0;
}
