#version 430
// Hand the part of the elastic height that is beyond the yield height over to the permanent one.
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Height { vec4 h[]; };
layout(std430, binding = 1) buffer Dent { vec4 dent[]; };
layout(std430, binding = 2) readonly buffer YieldHeight { vec4 limit[]; };

void main() {
    uint quad = gl_GlobalInvocationID.x;
    if (quad >= h.length()) return;
    vec4 height = h[quad];
    vec4 kept = clamp(height, -limit[quad], limit[quad]);
    dent[quad] += height - kept;
    h[quad] = kept;
}
