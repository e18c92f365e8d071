// Where the places of charts with halo lie on a page, see `ChartPage`.
layout(rgba32f, binding = 0) uniform image2DArray page;
uniform int layer;
const int BLOCK = N + 2;

ivec3 on_page(int place) {
    int chart = place / (BLOCK * BLOCK), row = place / BLOCK % BLOCK, column = place % BLOCK;
    return ivec3(chart % COLUMNS * BLOCK + column, chart / COLUMNS * BLOCK + row, layer);
}
