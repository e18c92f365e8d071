// Encoding of the G-buffer: its colour attachments have four channels of 16 bits.
const float UNORM16 = 65535.0;

// Octahedral encoding of a direction, as a point of the unit square.
vec2 octahedral_encode(vec3 n)
{
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 outer = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return 0.5 + 0.5 * (n.z < 0.0 ? outer : n.xy);
}

vec3 octahedral_decode(vec2 code)
{
    vec2 p = 2.0 * code - 1.0;
    float z = 1.0 - abs(p.x) - abs(p.y), under = max(-z, 0.0);
    return normalize(vec3(p.x - (p.x < 0.0 ? -under : under), p.y - (p.y < 0.0 ? -under : under), z));
}

// Two values of 8 bits, 0 to 1, in a channel of 16 bits.
float pack_unorm8(float high, float low)
{
    return dot(floor(255.0 * clamp(vec2(high, low), 0.0, 1.0) + 0.5), vec2(256.0, 1.0)) / UNORM16;
}

vec2 unpack_unorm8(float channel)
{
    float bits = floor(UNORM16 * channel + 0.5), high = floor(bits / 256.0);
    return vec2(high, bits - 256.0 * high) / 255.0;
}

// Number of an object in the table of objects, and whether its inner side is visible.
const int INNER_SIDE = 32768;

float pack_object(float number, bool inner)
{
    return (number + (inner ? float(INNER_SIDE) : 0.0)) / UNORM16;
}

int unpack_object(float channel)
{
    return int(channel * UNORM16 + 0.5) & INNER_SIDE - 1;
}

bool unpack_inner(float channel)
{
    return int(channel * UNORM16 + 0.5) >= INNER_SIDE;
}

// Texels of the G-buffer for a surface. `g_normal` contains the normal of the visible side, without ripples; the packed
// object; ambient visibility with half the thickness. `g_color` contains the place on the page of the height map, 0 to 1; red
// with green; blue with ink. `color` is the square root of the albedo; `baked` contains ambient visibility and half the
// thickness; `ink` is the opacity of lines on top.
void encode_surface(vec3 normal, vec2 place, vec3 color, float object, vec2 baked, float ink, out vec4 g_normal, out vec4 g_color)
{
    g_normal = vec4(octahedral_encode(normal), object, pack_unorm8(baked.x, baked.y));
    g_color = vec4(place, pack_unorm8(color.r, color.g), pack_unorm8(color.b, ink));
}
