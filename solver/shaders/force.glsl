// Sum over the eight links of weight (x_j - x_i); `w` and `x` are the stencil and the padded field.
#define FORCE(w, x, t, result)                                                     \
    {                                                                              \
        int i = padded_index(t), e = link_index(t, 0), n = link_index(t, 1);       \
        int ne = link_index(t, 2), nw = link_index(t, 3);                          \
        float here = x[i];                                                         \
        result = w[e] * (x[i + 1] - here)                                          \
            + w[e - 1] * (x[i - 1] - here)                                         \
            + w[n] * (x[i + PADDED] - here)                                        \
            + w[n - CELLS] * (x[i - PADDED] - here)                                \
            + w[ne] * (x[i + PADDED + 1] - here)                                   \
            + w[ne - CELLS - 1] * (x[i - PADDED - 1] - here)                       \
            + w[nw - CELLS] * (x[i - PADDED + 1] - here)                           \
            + w[nw - 1] * (x[i + PADDED - 1] - here);                              \
    }
