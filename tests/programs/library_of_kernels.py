"""Two kernels; tests/solver/test_kernel.py copies and changes this module."""

from ripple_sim.solver.kernel import kernel


@kernel
def sum_of(x):
    total = 0.0
    for each in x:
        total += each
    return total


@kernel
def value_at(x, i):
    return x[i]
