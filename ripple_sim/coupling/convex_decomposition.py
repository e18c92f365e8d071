"""Decomposition of a mesh into convex parts, by CoACD, kept in the user's cache."""

from __future__ import annotations

import contextlib
import importlib.metadata

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh
from ripple_sim.solver.cache import cache_path, make_room, mark_used
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.texels.atlas import read_arrays, write_arrays

# CoACD's own threshold of concavity: parts then lie up to 2.5 % of a mesh's size off the surface. With a third of its
# usual iterations it finds as good cuts in half the time.
_SETTINGS = {"threshold": 0.05, "mcts_iterations": 60, "seed": 0}


def convex_parts(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Vertices of the convex parts of a mesh [m], each [n, 3]; the same for the same mesh.

    Wei et al. 2022, "Approximate convex decomposition for 3D meshes with collision-aware concavity and tree search".

    Raises
    ------
    SceneError
        If the package coacd is missing.
    """
    try:
        version = importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError as error:
        raise SceneError(
            "the route 'convex' needs coacd, which is not installed; install it with: pip install "
            "'ripple-sim[convex]', or take another route, such as 'sdf'"
        ) from error
    path = cache_path(f"convex parts {version} {_SETTINGS}", (mesh.V, mesh.F))
    with contextlib.suppress(OSError, ValueError, KeyError):
        stored = read_arrays(path)
        mark_used(path)
        return [stored[str(i)] for i in range(len(stored))]
    parts = _decompose(mesh)
    # a folder that cannot be written costs the next call its time, nothing else
    with contextlib.suppress(OSError), atomic_write(path) as unfinished, unfinished.open("wb") as file:
        write_arrays(file, {str(i): part for i, part in enumerate(parts)})
    make_room(path)
    return parts


def _decompose(mesh: Mesh) -> list[NDArray[np.float64]]:
    import coacd

    coacd.set_log_level("error")
    return [np.array(V, dtype=np.float64) for V, _ in coacd.run_coacd(coacd.Mesh(mesh.V, mesh.F), **_SETTINGS)]
