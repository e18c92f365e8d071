#version 430
// The plain way: one thread a texel, everything in storage buffers. v += dt gain force, then h_next = h + dt v.
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Height { float h[]; };
layout(std430, binding = 1) buffer Velocity { float v[]; };
layout(std430, binding = 2) writeonly buffer HeightNext { float h_next[]; };
layout(std430, binding = 3) readonly buffer Stencil { float w[]; };
layout(std430, binding = 4) readonly buffer Gain { float gain[]; };
uniform float dt;

const int HALO_WIDTH = N + 2, CELLS = N + 1, LINKS = CELLS * CELLS;

void main() {
    ivec3 t = ivec3(gl_GlobalInvocationID);
    if (t.x >= N) return;
    int p = (t.z * HALO_WIDTH + t.y + 1) * HALO_WIDTH + t.x + 1;
    int e = (t.z * 4 * CELLS + t.y + 1) * CELLS + t.x + 1, n = e + LINKS, ne = n + LINKS, nw = ne + LINKS;
    float here = h[p];
    float force = w[e] * (h[p + 1] - here) + w[e - 1] * (h[p - 1] - here)
        + w[n] * (h[p + HALO_WIDTH] - here) + w[n - CELLS] * (h[p - HALO_WIDTH] - here)
        + w[ne] * (h[p + HALO_WIDTH + 1] - here) + w[ne - CELLS - 1] * (h[p - HALO_WIDTH - 1] - here)
        + w[nw - CELLS] * (h[p - HALO_WIDTH + 1] - here) + w[nw - 1] * (h[p + HALO_WIDTH - 1] - here);
    float kicked = v[p] + dt * gain[(t.z * N + t.y) * N + t.x] * force;
    v[p] = kicked;
    h_next[p] = here + dt * kicked;
}
