// Fields are charts with halo, [C, N + 2, N + 2]; a thread works on one texel of them.
uniform int count;  // of texels

const int PITCH = N + 2;

// Where a texel lies, by its flat index; -1 beyond the last.
int address(int texel) {
    int row = texel / N;
    return texel < count ? (row + 2 * (row / N) + 1) * PITCH + texel % N + 1 : -1;
}
