// The table of objects; contract.py describes the members of a row. It is a texture, since software drivers read storage
// buffers number by number.
struct Object { OBJECT_MEMBERS };

layout(binding = OBJECTS_UNIT) uniform sampler2D object_table;  // OBJECT_COLUMNS rows beside each other, a vector a texel

Object object_at(int number)
{
    ivec2 first = ivec2((number & OBJECT_COLUMNS - 1) * OBJECT_TEXELS, number / OBJECT_COLUMNS);
    vec4 row[OBJECT_TEXELS];
    for (int i = 0; i < OBJECT_TEXELS; ++i)
        row[i] = texelFetch(object_table, first + ivec2(i, 0), 0);
    return Object(row[0], row[1], row[2], row[3], mat3(row[4].xyz, row[5].xyz, row[6].xyz));
}
