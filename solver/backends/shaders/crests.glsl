#version 430
// Raise the crests to the size of the height, with what is permanent of it. Bits of positive floats are in the order of
// the floats, and those of what is no number are beyond.
layout(local_size_x = LIST_GROUP) in;
layout(std430, binding = 0) readonly buffer Height { dvec4 h[]; };
layout(std430, binding = 1) buffer Crests { dvec4 crests[]; };
#ifdef DENT
layout(std430, binding = 2) readonly buffer Dent { dvec4 dent[]; };
#endif

#include "eights.glsl"

void main() {
    uint eight = gl_GlobalInvocationID.x;
    if (eight >= h.length()) return;
    float height[8] = unpack(h[eight]), crest[8] = unpack(crests[eight]);
#ifdef DENT
    float stays[8] = unpack(dent[eight]);
#endif
    for (int i = 0; i < 8; i++) {
#ifdef DENT
        height[i] += stays[i];
#endif
        crest[i] = uintBitsToFloat(max(floatBitsToUint(crest[i]), floatBitsToUint(abs(height[i]))));
    }
    crests[eight] = pack(crest);
}
