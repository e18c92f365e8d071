// Fields are charts with halo, [CHARTS, N + 2, N + 2]; a thread works on one texel of them.
const int PITCH = N + 2;
const int FIELD = CHARTS * PITCH * PITCH;  // places of a field

// Whether a thread has no texel to work on. Where the groups hold the texels exactly, every thread has one.
bool beyond(uint texel) {
#if CHARTS * N * N % GROUP == 0
    return false;
#else
    return texel >= uint(CHARTS * N * N);
#endif
}

// Where a texel lies, by its flat index. Unsigned numbers are cheaper to divide.
int address(uint texel) {
    uint row = texel / uint(N), chart = row / uint(N);
    return int(texel + 2u * row + chart * uint(2 * PITCH)) + PITCH + 1;
}
