#version 430
// Sorts the tiles of the frame by how their background is filled; see background_tiles.py.
#include "passes/coarse_background.glsl"

layout(local_size_x = GROUP) in;
layout(std430, binding = TILES_BINDING) writeonly buffer Tiles { vec2 corners[]; };
layout(std430, binding = COMMANDS_BINDING) buffer Commands { uint commands[]; };  // five of an indirect draw for each kind

uniform ivec2 tiles;  // of the frame, along its edges
uniform vec2 extent;  // of a tile, where the frame extends from -1 to 1

const float PLAIN = 0.4 / 255.0;  // largest error of a colour that is interpolated from a tile's corners
const int SIDE = TILE / 2;        // of a tile, in squares of 2 x 2 blocks

// Mean of a square; it begins at a place that is given in squares from the tile's lower left corner.
vec4 square(ivec2 tile, vec2 at)
{
    return textureLod(coarse, (vec2(tile * TILE) + 2.0 * at) / vec2(textureSize(coarse, 0)), 0.0);
}

int kind_of(ivec2 tile)
{
    vec3 lower = square(tile, vec2(0)).rgb, right = square(tile, vec2(SIDE, 0)).rgb;
    vec3 upper = square(tile, vec2(0, SIDE)).rgb, last = square(tile, vec2(SIDE)).rgb;
    vec3 off = abs(lower + last - right - upper);  // the tile is two triangles
    float least = 1.0, most = 0.0;
    // a ring about the tile as well, from which pixels at its edges are interpolated
    for (int y = -1; y <= SIDE; ++y)
        for (int x = -1; x <= SIDE; ++x) {
            vec2 at = vec2(x, y) + 0.5, share = at / float(SIDE);
            vec4 shown = square(tile, at);
            least = min(least, shown.a);
            most = max(most, shown.a);
            bool within = clamp(share, 0.0, 1.0) == share;
            vec3 between = mix(mix(lower, right, share.x), mix(upper, last, share.x), share.y);
            off = max(off, within ? abs(shown.rgb - between) : vec3(0.0));
        }
    bool smooth_all_over = least == most && (least == 0.0 || most == 1.0);
    return !smooth_all_over ? 2 : max(off.r, max(off.g, off.b)) < PLAIN ? 0 : 1;
}

void main()
{
    int number = int(gl_GlobalInvocationID.x), count = tiles.x * tiles.y;
    if (number >= count)
        return;
    ivec2 tile = ivec2(number % tiles.x, number / tiles.x);
    int kind = kind_of(tile);
    uint place = atomicAdd(commands[5 * kind + 1], 1u);
    corners[kind * count + int(place)] = vec2(tile) * extent - 1.0;
}
