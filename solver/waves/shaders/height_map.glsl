#version 430
// Gradient and height of the texel that each place of the charts with halo shows, into a page of charts, see `ChartPage`.
// What lies beyond a fixed rim is the texels' mirror image, with heights turned over. After that, with CORNERS, the
// corners of the halo that show no texel: the mean of the three places about them, or, in a fixed rim, the height that
// makes the mean of all four 0.
layout(rgba32f, binding = 0) uniform image2DArray page;
uniform int layer;
const int BLOCK = N + 2;

ivec3 on_page(int place) {
    int chart = place / (BLOCK * BLOCK), row = place / BLOCK % BLOCK, column = place % BLOCK;
    return ivec3(chart % COLUMNS * BLOCK + column, chart / COLUMNS * BLOCK + row, layer);
}

#ifdef CORNERS
layout(std430, binding = 0) readonly buffer Corners { ivec4 corners[]; };  // place, and the three about it
uniform int means, count;  // the first ones are means

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    ivec4 corner = corners[i];
    vec4 sum = imageLoad(page, on_page(corner.y)) + imageLoad(page, on_page(corner.z)) + imageLoad(page, on_page(corner.w));
    vec4 there = imageLoad(page, on_page(corner.x));
    imageStore(page, on_page(corner.x), i < means ? sum / 3.0 : vec4(there.xyz, -sum.w));
}
#else
layout(std430, binding = 0) readonly buffer Around { float around[]; };
layout(std430, binding = 1) readonly buffer Weights { float weights[]; };  // 8 vectors a texel
layout(std430, binding = 2) readonly buffer Sources { int sources[]; };

const int NEXT[8] = int[8](1, BLOCK + 1, BLOCK, BLOCK - 1, -1, -BLOCK - 1, -BLOCK, -BLOCK + 1);

void main() {
    int place = int(gl_GlobalInvocationID.x);
    if (place >= sources.length() || sources[place] == -1) return;
    bool turned = sources[place] < 0;
    int texel = turned ? -2 - sources[place] : sources[place];
    int own = (texel / (N * N) * BLOCK + texel / N % N + 1) * BLOCK + texel % N + 1;
    float here = around[own];
    vec3 gradient = vec3(0.0);
    for (int k = 0; k < 8; k++) {
        int first = 24 * texel + 3 * k;
        gradient += vec3(weights[first], weights[first + 1], weights[first + 2]) * (around[own + NEXT[k]] - here);
    }
    imageStore(page, on_page(place), vec4(gradient, turned ? -here : here));
}
#endif
