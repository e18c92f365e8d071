"""A program that runs pymeshfix on the arrays of one file and writes the result to another file.

`repair` starts it as a process of its own, because on some surfaces pymeshfix ends the process in
which it runs.
"""

from __future__ import annotations

import sys

import numpy as np


def main(source: str, target: str) -> None:
    """Fill the holes of all parts. Both files hold V [n, 3] and F [m, 3]."""
    from pymeshfix import PyTMesh

    with np.load(source) as arrays:
        V = arrays["V"]
        F = arrays["F"]
    surface = PyTMesh()
    surface.set_quiet(True)
    surface.load_array(V, F.astype(np.int32))
    surface.fill_small_boundaries(nbe=0, refine=True)
    V, F = surface.return_arrays()
    np.savez(target, V=V, F=F)


if __name__ == "__main__":
    main(*sys.argv[1:])
