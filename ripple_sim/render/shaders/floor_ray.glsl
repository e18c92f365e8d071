// The floor is a plane that every ray meets in closed form; a map of it tells how open it lies.
const float MISSED = 1e9;

// How far along the way from the eye the floor's upper side lies.
float floor_distance(vec3 way)
{
    float down = -dot(way, floor_normal.xyz), height = dot(eye.xyz - floor_origin.xyz, floor_normal.xyz);
    float at = height / max(down, 1e-9);
    vec3 local = eye.xyz + at * way - floor_origin.xyz;
    bool inside = abs(dot(local, floor_u.xyz)) < floor_u.w && abs(dot(local, floor_v.xyz)) < floor_v.w;
    return floor_origin.w > 0.0 && height > 0.0 && down > 1e-6 && inside ? at : MISSED;
}

// Where a point of the floor lies in its map.
vec2 floor_place(vec3 world)
{
    vec3 local = world - floor_origin.xyz;
    return (vec2(dot(local, floor_u.xyz), dot(local, floor_v.xyz)) - floor_map.xy) / (2.0 * floor_map.z) + 0.5;
}
