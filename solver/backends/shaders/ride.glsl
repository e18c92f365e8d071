#version 430
// Places of the texels with halo, on vertices that have moved. In double precision: what counts are their differences.
layout(std430, binding = 0) readonly buffer Vertices { double vertices[]; };
layout(std430, binding = 1) readonly buffer Corners { int corners[]; };
layout(std430, binding = 2) readonly buffer Barycentrics { double barycentrics[]; };
layout(std430, binding = 3) writeonly buffer Places { double places[]; };  // all x, all y, all z
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    for (int k = 0; k < 3; k++) {
        double sum = 0.0;
        for (int corner = 3 * i; corner < 3 * i + 3; corner++)
            sum += barycentrics[corner] * vertices[3 * corners[corner] + k];
        places[k * count + i] = sum;
    }
}
