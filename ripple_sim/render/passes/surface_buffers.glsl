#version 410
// The surface at the middle of each pixel, without light: of a solid, transparent or not, or of the floor.
#include "glsl/view.glsl"

#stage fragment
#include "glsl/g_buffer_samples.glsl"
#include "glsl/height_maps.glsl"
#include "glsl/objects.glsl"

layout(location = 0) out vec4 shown;   // normal with ripples, in the world; distance along the camera's axis [m]
layout(location = 1) out vec4 smooth_surface;  // normal without ripples; number of the object + 1, 0: nothing, -1: floor
layout(location = 2) out vec4 rippling;  // place on the page of charts [texels]; layer of the height map, -1: none; height [m]

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(depths, pixel, 0).r;
    shown = smooth_surface = vec4(0.0);
    rippling = vec4(0.0, 0.0, -1.0, 0.0);
    if (depth < min(floor_depth(), 0.99999994)) {
        vec4 normal = texelFetch(normals, pixel, 0), color = texelFetch(colors, pixel, 0);
        int number = unpack_object(normal.z);
        Object object = object_at(number);
        vec2 place = color.xy * vec2(textureSize(height_maps, 0).xy);
        bool flat_surface = object.height_map.y == 0.0;  // its layer may never have been written
        vec4 ripple = flat_surface ? vec4(0.0) : spline_at(height_maps, vec3(place, object.height_map.x));
        vec3 out_of = octahedral_decode(normal.xy);
        float side = unpack_inner(normal.z) ? -1.0 : 1.0;
        shown = vec4(normalize(out_of - side * object.rotation * ripple.xyz), eye_distance(depth));
        smooth_surface = vec4(side * out_of, float(number) + 1.0);
        if (!flat_surface)
            rippling = vec4(place, object.height_map.x, ripple.w);
    } else if (meets_floor()) {
        shown = vec4(floor_normal.xyz, floor_distance());
        smooth_surface = vec4(floor_normal.xyz, -1.0);
    }
}
