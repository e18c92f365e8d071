#version 410
// Chooses how each tile of the frame is filled from the coarse background: see `CoarseBackground`.
layout(binding = COARSE_BACKGROUND_UNIT) uniform sampler2D coarse;

#stage vertex
void main()
{
    gl_Position = vec4(4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2) - 1.0, 0.0, 1.0);
}

#stage fragment
const float LARGEST = 0.4 / 255.0;  // greatest error of a colour that is interpolated from a tile's corners
const int SIDE = TILE / 2;        // edge of a tile, in squares of 2 x 2 blocks

out uint kind;

// Mean of a square of blocks; `at` is its corner, in squares from the tile's lower left corner.
vec4 square(ivec2 tile, vec2 at)
{
    return textureLod(coarse, (vec2(tile * TILE) + 2.0 * at) / vec2(textureSize(coarse, 0)), 0.0);
}

void main()
{
    ivec2 tile = ivec2(gl_FragCoord.xy);
    vec3 lower = square(tile, vec2(0)).rgb, right = square(tile, vec2(SIDE, 0)).rgb;
    vec3 upper = square(tile, vec2(0, SIDE)).rgb, last = square(tile, vec2(SIDE)).rgb;
    vec3 off = abs(lower + last - right - upper);  // the tile is two triangles
    float least = 1.0, most = 0.0;
    // with a ring of squares about the tile, from which pixels at its edges are interpolated
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
    kind = !smooth_all_over ? 2u : max(off.r, max(off.g, off.b)) < LARGEST ? 0u : 1u;
}
