// Walks 8 columns and ROWS rows of a strip upwards and hands the stencil's sum at every texel to
//
//     void emit(int eight, float here[8], float force[8])
//
// Each link is read once for both of its ends: what a row needs of the row below stays in registers. Threads side by
// side read what lies side by side. Fields are strips of [N + 2, STRIDE] floats, read by eights; the texels begin at
// column 8, and the halo lies round them. `x` is the field, `w` the links that start in each place, shifted
// by one column to the right: east, north, north-east, and from its east to its north.
layout(local_size_x = GROUP_COLUMNS, local_size_y = GROUP_ROWS) in;
const int PITCH = STRIDE / 8;

// The row of eight texels and one on either side.
void read_row(int eight, out float row[10]) {
    float texels[8] = unpack(x[eight]);
    row[0] = uintBitsToFloat(unpackDouble2x32(x[eight - 1].w)).y;
    for (int i = 0; i < 8; i++) row[i + 1] = texels[i];
    row[9] = uintBitsToFloat(unpackDouble2x32(x[eight + 1].x)).x;
}

// The links that start in the place before the eight texels, in them, and one more.
void read_links(int eight, out vec4 links[10]) {
    for (int i = 0; i < 5; i++) {
        float two[8] = unpack(w[4 * eight + i]);
        links[2 * i] = vec4(two[0], two[1], two[2], two[3]);
        links[2 * i + 1] = vec4(two[4], two[5], two[6], two[7]);
    }
}

void main() {
    ivec3 block = ivec3(gl_GlobalInvocationID);
    int first = block.y * ROWS;
    if (block.x * 8 >= WIDTH || first >= N) return;
    int eight = (block.z * (N + 2) + first) * PITCH + block.x + 1;

    float below[10], here[10], above[10];
    vec4 links[10];
    read_row(eight, below);
    read_row(eight + PITCH, here);
    read_links(eight, links);
    // flow along the links that come up from the row below: straight, from the left, and to the left of each place
    float up[9], from_left[9], from_right[9];
    for (int j = 0; j <= 8; j++) {
        up[j] = links[j].y * (here[j] - below[j]);
        from_left[j] = links[j].z * (here[j + 1] - below[j]);
        from_right[j] = links[j].w * (here[j] - below[j + 1]);
    }
    for (int row = first; row < min(first + ROWS, N); row++) {
        eight += PITCH;
        read_row(eight + PITCH, above);
        read_links(eight, links);
        float west = links[0].x * (here[1] - here[0]);
        float up_left = links[0].w * (above[0] - here[1]);
        float south_west = from_left[0];
        from_left[0] = links[0].z * (above[1] - here[0]);
        float center[8], force[8];
        for (int i = 0; i < 8; i++) {
            int j = i + 1;
            float east = links[j].x * (here[j + 1] - here[j]);
            float north = links[j].y * (above[j] - here[j]);
            float north_east = links[j].z * (above[j + 1] - here[j]);
            float next_up_left = links[j].w * (above[j] - here[j + 1]);
            center[i] = here[j];
            force[i] = (east - west) + (north - up[j]) + (north_east - south_west) + (up_left - from_right[j]);
            west = east;
            up[j] = north;
            south_west = from_left[j];
            from_left[j] = north_east;
            up_left = next_up_left;
            from_right[j] = next_up_left;
        }
        emit(eight, center, force);
        here = above;
    }
}
