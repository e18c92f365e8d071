#include "gpu/g_buffer.glsl"

layout(location = 0) out vec4 g_normal;  // normal without ripples; object; ambient visibility with half the thickness
layout(location = 1) out vec4 g_color;   // place in the height map; red with green; blue with ink

// `normal` is that of the side which is seen; `object` is packed. `color` is the square root of the albedo; `baked` holds
// ambient visibility and half the thickness; `ink` is the opacity of lines on top. The place in the height map is that on
// its page, 0 to 1.
void write_g_buffer(vec3 normal, vec2 place, vec3 color, float object, vec2 baked, float ink)
{
    g_normal = vec4(octahedral_encode(normal), object, pack_unorm8(baked.x, baked.y));
    g_color = vec4(place, pack_unorm8(color.r, color.g), pack_unorm8(color.b, ink));
}
