// Rays from the eye through the frame, and where they meet the plane of the floor. Values that vary linearly over the frame
// are computed at the vertices: of one triangle over the whole framebuffer; with TILES 1 of square tiles of the frame, as
// instances; with TILES 2 of the tiles of one kind.
#include "glsl/held_uniforms.glsl"

VARYING vec2 screen;          // position in the frame, from -1 to 1
VARYING vec3 start;           // start of the ray: the eye, unless rays are parallel
VARYING vec3 eye_local;       // `start` along the floor's axes, from its origin; below the floor where there is no floor
VARYING vec3 way;             // along the ray, one metre along the camera's axis
VARYING vec3 way_local;       // `way` along the floor's axes, with z downwards
flat VARYING vec4 limits;     // half sizes of the floor, near and far plane [m]
flat VARYING float parallel;  // 1 where rays are parallel
flat VARYING float nearest;   // how far away the floor begins to show [m]
flat VARYING vec3 focus_local;
flat VARYING vec3 around;   // ambient light on the open floor, without the soft box of the key light
flat VARYING vec3 key_box;  // the soft box of the key light
flat VARYING vec3 floor_lit, floor_surround;  // radiance of the open floor: from the lights, and from the surroundings

#stage vertex
#include "glsl/lights.glsl"

uniform float level;  // depth of the vertices
#if TILES == 2
#include "glsl/tiles.glsl"
#elif TILES
in vec2 in_corner;    // the tile's lower left
uniform vec2 extent;  // of a tile
#else
uniform vec2 span = vec2(1.0);  // of the framebuffer, in frames
uniform float reach = 1.0;      // of the viewport, in framebuffers
#endif

vec3 along_floor(vec3 v)
{
    return vec3(dot(v, floor_u.xyz), dot(v, floor_v.xyz), dot(v, floor_normal.xyz));
}

void main()
{
#if TILES == 2
    screen = tile_corner();
#elif TILES
    screen = in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    vec2 drawn = screen;
#else
    vec2 corner = 4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2), drawn = corner / reach - 1.0;
    screen = corner * span - 1.0;
#endif
    parallel = ray_up.w;
    way = ray.xyz;
    start = eye.xyz;
    vec3 beside = screen.x * ray_right.xyz, above = screen.y * ray_up.xyz;
    if (parallel > 0.0)
        start = start + beside + above;
    else
        way = way + beside + above;
    way_local = along_floor(way) * vec3(1.0, 1.0, -1.0);
    eye_local = along_floor(start - floor_origin.xyz);
    eye_local.z = floor_origin.w > 0.0 ? eye_local.z : -1.0;
    limits = vec4(floor_u.w, floor_v.w, ray.w, ray_right.w);
    nearest = focus.w;
    focus_local = along_floor(focus.xyz - floor_origin.xyz);
    around = ambient(floor_normal.xyz, vec3(0.0), vec3(0.0));
    key_box = diffuse_box(0, floor_normal.xyz);
    floor_lit = floor_albedo.rgb * (floor_light.rgb + key_box);
    floor_surround = floor_albedo.rgb * around;
    hold_uniforms();
#if TILES == 2
    gl_Position = on_tile(level);
#else
    gl_Position = vec4(drawn, 2.0 * level - 1.0, 1.0);
#endif
}

#stage fragment
// Negative where the ray meets the floor's plane between two of the floor's edges; varies linearly across them.
vec2 beside_edges()
{
    return abs(way_local.z * eye_local.xy + eye_local.z * way_local.xy) - way_local.z * limits.xy;
}

// Negative where the ray meets the floor's upper side beyond the near plane; varies linearly across the edges.
float beside_floor()
{
    vec2 beside = beside_edges();
    float too_near = nearest * way_local.z - eye_local.z;
    return max(max(max(beside.x, beside.y), 1e-6 * eye_local.z - way_local.z), too_near);
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
    float range = limits.w - limits.z;
    return parallel > 0.0 ? limits.z + depth * range : limits.z * limits.w / (limits.w - depth * range);
}

// Depth of the floor in the buffer; 1 where the ray misses it.
float floor_depth()
{
    float met = (limits.w - limits.z * limits.w * way_local.z / eye_local.z) / (limits.w - limits.z);
    float met_parallel = (floor_distance() - limits.z) / (limits.w - limits.z);
    return meets_floor() ? parallel > 0.0 ? met_parallel : met : 1.0;
}
