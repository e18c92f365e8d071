#version 430
// Gradient and height of the texel that each place of the charts with halo shows, into a page of charts. What lies
// beyond a fixed rim is the texels' mirror image, with heights turned over.
layout(local_size_x = GROUP) in;
layout(std430, binding = 0) readonly buffer Around { float around[]; };
layout(std430, binding = 1) readonly buffer Weights { float weights[]; };  // 8 vectors a texel
layout(std430, binding = 2) readonly buffer Sources { int sources[]; };

#include "waves/shaders/page.glsl"

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
