// Addresses of the padded faces and of the stencil; see stencil.py. N is put in when the shader is compiled.
const int PADDED = N + 2;
const int CELLS = N + 1;

bool inside(ivec3 texel) { return texel.x < N && texel.y < N && texel.z < 6; }

// own texel (column, row, face), 0-based, as a place in a [6, N, N] field
int texel_index(ivec3 t) { return (t.z * N + t.y) * N + t.x; }

// the same texel in a padded [6, N + 2, N + 2] field
int padded_index(ivec3 t) { return (t.z * PADDED + t.y + 1) * PADDED + t.x + 1; }

// the link that starts in the same texel's padded cell, in a [6, 4, N + 1, N + 1] stencil
int link_index(ivec3 t, int link) { return ((t.z * 4 + link) * CELLS + t.y + 1) * CELLS + t.x + 1; }
