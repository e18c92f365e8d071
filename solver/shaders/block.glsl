// Walks a block of QUADS x 4 columns and ROWS rows upwards and hands the stencil's sum at every texel to
//
//     void emit(int quad, vec4 here, vec4 force)
//
// Each link is read once for both of its ends: what a row needs of the row below stays in registers. Fields are faces of
// [N + 2, STRIDE] floats, read by fours; the texels begin at column 4, and the ring of neighbours lies round them.
// `x` is the field, `w` the links that start in each place: east, north, north-east, and from its east to its north.
layout(local_size_x = 8, local_size_y = 4) in;
const int WIDTH = 4 * QUADS;
const int PITCH = STRIDE / 4;

void read_row(int quad, out float row[WIDTH + 2]) {
    row[0] = x[quad - 1].w;
    for (int q = 0; q < QUADS; q++)
        for (int i = 0; i < 4; i++) row[4 * q + i + 1] = x[quad + q][i];
    row[WIDTH + 1] = x[quad + QUADS].x;
}

void main() {
    ivec3 block = ivec3(gl_GlobalInvocationID);
    int first = block.y * ROWS;
    if (block.x * WIDTH >= N || first >= N) return;
    int quad = (block.z * (N + 2) + first) * PITCH + block.x * QUADS + 1;

    float below[WIDTH + 2], here[WIDTH + 2], above[WIDTH + 2];
    read_row(quad, below);
    read_row(quad + PITCH, here);
    // flow along the links that come up from the row below: straight, from the left, and to the left of each place
    float up[WIDTH + 1], from_left[WIDTH + 1], from_right[WIDTH + 1];
    for (int j = 0; j <= WIDTH; j++) {
        vec4 link = w[4 * quad + j - 1];
        up[j] = link.y * (here[j] - below[j]);
        from_left[j] = link.z * (here[j + 1] - below[j]);
        from_right[j] = link.w * (here[j] - below[j + 1]);
    }
    for (int row = first; row < min(first + ROWS, N); row++) {
        quad += PITCH;
        read_row(quad + PITCH, above);
        vec4 link = w[4 * quad - 1];
        float west = link.x * (here[1] - here[0]);
        float up_left = link.w * (above[0] - here[1]);
        float south_west = from_left[0];
        from_left[0] = link.z * (above[1] - here[0]);
        for (int q = 0; q < QUADS; q++) {
            vec4 center, force;
            for (int i = 0; i < 4; i++) {
                int j = 4 * q + i + 1;
                link = w[4 * quad + j - 1];
                float east = link.x * (here[j + 1] - here[j]);
                float north = link.y * (above[j] - here[j]);
                float north_east = link.z * (above[j + 1] - here[j]);
                float next_up_left = link.w * (above[j] - here[j + 1]);
                center[i] = here[j];
                force[i] = (east - west) + (north - up[j]) + (north_east - south_west) + (up_left - from_right[j]);
                west = east;
                up[j] = north;
                south_west = from_left[j];
                from_left[j] = north_east;
                up_left = next_up_left;
                from_right[j] = next_up_left;
            }
            emit(quad + q, center, force);
        }
        here = above;
    }
}
