#version 430
// Heights with their halo; with LIMIT as `DisplacementLimit` bends them.
layout(std430, binding = 0) writeonly buffer Around { float around[]; };
layout(std430, binding = 2) readonly buffer Sources { int sources[]; };
layout(std430, binding = 3) readonly buffer Heights { float heights[]; };
#ifdef LIMIT
layout(std430, binding = 4) readonly buffer Radii { float radii[]; };

#include "backends/shaders/peak.glsl"
#endif

const int BLOCK = N + 2;

// Height of the texel that a place shows; 0 where it shows none, and beyond a fixed rim.
float height_at(int place) {
    int texel = place < sources.length() ? sources[place] : -1;
    if (texel < 0) return 0.0;
    float height = heights[texel];
#ifdef LIMIT
    const float RANGE = MAX_SHARE - FREE_SHARE;
    float share = min(abs(height) / radii[texel], 1e3), beyond = (share - FREE_SHARE) / RANGE;
    if (share > FREE_SHARE) height = sign(height) * radii[texel] * (FREE_SHARE + RANGE * tanh(beyond));
#endif
    return height;
}

void main() {
    int place = int(gl_GlobalInvocationID.x);
    float height = height_at(place);
    if (place < sources.length() && sources[place] == -1) {
        // a corner of other than four charts has the mean of the three places about it
        int row = place / BLOCK % BLOCK > 0 ? -BLOCK : BLOCK, column = place % BLOCK > 0 ? -1 : 1;
        height = (height_at(place + row + column) + height_at(place + row) + height_at(place + column)) / 3.0;
    }
#ifdef LIMIT
    raise_peak(height);
#endif
    if (place < sources.length()) around[place] = height;
}
