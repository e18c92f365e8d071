// The cube's convention: how a direction from its centre meets a face. As in solver/texels/cube_map.

// A direction along a face's two axes and its normal. The faces are +x, -x, +y, -y, +z, -z.
vec3 along_face(float face, vec3 d)
{
    if (face < 2.0)
        return face < 1.0 ? vec3(d.y, d.z, d.x) : vec3(-d.y, d.z, -d.x);
    if (face < 4.0)
        return face < 3.0 ? vec3(-d.x, d.z, d.y) : vec3(d.x, d.z, -d.y);
    return face < 5.0 ? vec3(d.x, d.y, d.z) : vec3(d.x, -d.y, -d.z);
}

float face_of(vec3 d)
{
    vec3 size = abs(d);
    if (size.x >= size.y && size.x >= size.z)
        return d.x < 0.0 ? 1.0 : 0.0;
    if (size.y >= size.z)
        return d.y < 0.0 ? 3.0 : 2.0;
    return d.z < 0.0 ? 5.0 : 4.0;
}

// Column, row (in texels of the face with its halo) and face that a direction meets; columns and rows go with the angle.
vec3 height_map_position(vec3 d, float resolution)
{
    float face = face_of(d);
    vec3 at = along_face(face, d);
    vec2 angle = atan(at.xy / at.z) * 1.27323954;  // 4 / pi
    return vec3((angle + 1.0) * 0.5 * resolution + 1.0, face);
}

// How far the column and the row on a face move [texels] as the direction changes.
vec2 position_change(float face, vec3 direction, vec3 change, float resolution)
{
    vec3 at = along_face(face, direction), by = along_face(face, change);
    vec2 q = at.xy / at.z;
    return 0.63661977 * resolution * (by.xy - q * by.z) / (at.z * (1.0 + q * q));
}
