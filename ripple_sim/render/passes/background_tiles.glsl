#version 430
// Fills the frame from the background at a fraction of its resolution, tile by tile; see background.py. The compute shader
// sorts the tiles by how they are filled. With PLAIN pixels are interpolated from the corners of their tile, otherwise from
// the coarse background; with ROUGH those where that is not smooth are marked as a depth.
layout(binding = COARSE_BACKGROUND_UNIT) uniform sampler2D coarse;  // a: 1 for floor, 0 for sky, between them where rough

#stage compute
layout(local_size_x = GROUP) in;
layout(std430, binding = TILES_BINDING) writeonly buffer Tiles { vec2 corners[]; };
layout(std430, binding = COMMANDS_BINDING) buffer Commands { uint commands[]; };  // five of an indirect draw for each kind

uniform ivec2 tiles;  // of the frame, along its edges
uniform vec2 extent;  // of a tile, where the frame extends from -1 to 1

const float LARGEST = 0.4 / 255.0;  // largest error of a colour that is interpolated from a tile's corners
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
    return !smooth_all_over ? 2 : max(off.r, max(off.g, off.b)) < LARGEST ? 0 : 1;
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

#stage vertex
in vec2 in_corner;  // the tile's lower left

uniform float level;
uniform vec2 extent;  // of a tile
uniform vec2 blocks;  // of the background in a frame

out vec2 in_coarse;  // texture coordinates in the coarse background
out vec3 color;

void main()
{
    vec2 place = in_corner + extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    in_coarse = (0.5 + 0.5 * place) * blocks / vec2(textureSize(coarse, 0));
    color = textureLod(coarse, in_coarse, 0.0).rgb;
    gl_Position = vec4(place, 2.0 * level - 1.0, 1.0);
}

#stage fragment
#include "glsl/tone_mapping.glsl"

const float UNSURE = 0.002;  // weight of a block that is not smooth from which a pixel is left out

in vec2 in_coarse;
in vec3 color;
out vec4 fragment;

void main()
{
#if PLAIN
    vec4 shown = vec4(color, 1.0);
#else
    vec4 shown = textureLod(coarse, in_coarse, 0.0);
#endif
    fragment = vec4(dithered(shown.rgb), 1.0);
#if ROUGH
    // all four pixels of a block, so that they can share their search for what shades them
    gl_FragDepth = block_mean(min(shown.a, 1.0 - shown.a)) > UNSURE ? SHADED_LEVEL : OPEN_LEVEL;
#endif
}
