"""What is done to every surface as it is read, without asking: nothing that could be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .corners import Corners
from .counting import counted
from .cutting import cut_apart
from .merging import collapsed, distinct_triangles, merged_vertices
from .orientation import oriented
from .slivers import without_slivers
from .topology import distinct


def cleaned(
    V: NDArray[np.float64], F: NDArray[np.int64], uv: NDArray[np.float64] | None, name: str
) -> tuple[NDArray[np.float64], Corners, tuple[str, ...]]:
    """Make a triangle soup a manifold, oriented surface of triangles that have an area.

    Parameters
    ----------
    V : [vertex_count, 3]
    F : [triangle_count, 3]
    uv : [triangle_count, 3, 2], optional
    name : str
        Its name in messages.

    Returns
    -------
    V, corners
        A surface that needs nothing stays unchanged.
    notes : tuple of str
        What was done, one line each.

    Raises
    ------
    MeshError
        If no triangle has an area.
    """
    unused = len(V) - len(distinct(F))
    notes = [f"{counted(unused, 'unreferenced vertex')} dropped"] if unused else []
    merged, joined = merged_vertices(V, F)
    empty, keep = collapsed(merged), distinct_triangles(merged)
    corners, slivers = without_slivers(V, Corners(merged, F, uv).kept(keep))
    if len(corners.F) == 0:
        raise MeshError(f"{name} has no triangle with an area: none has three different corners that lie on no line")
    first_given = distinct(corners.F)
    compact = np.searchsorted(first_given, corners.F)
    points, corners, cuts = cut_apart(V[first_given], Corners(compact, corners.given, corners.uv), first_given)
    merges, splits = _changes(corners)
    turned, turns = oriented(points, corners)
    said = {
        f"{counted(merges - joined, 'duplicate vertex')} merged": merges > joined,
        f"cracks closed: {counted(joined, 'boundary vertex')} joined": joined,
        f"{counted(int(empty.sum()), 'triangle')} with a repeated vertex dropped": empty.any(),
        f"{counted(int((~keep & ~empty).sum()), 'repeated triangle')} dropped": (~keep & ~empty).any(),
        f"{counted(slivers, 'triangle')} without area dropped": slivers,
    }
    notes += [note for note, true in said.items() if true]
    # of a surface that was cut before, equal positions are merged and cut again, which nobody needs to know
    notes += cuts if merges or splits else []
    return points, turned, (*notes, *turns)


def _changes(corners: Corners) -> tuple[int, int]:
    """How many vertices became one with others, and how many came to be by cutting."""
    vertices, given = corners.F.max() + 1, corners.given.ravel()
    old = given >= 0
    pairs = distinct(given[old] * vertices + corners.F.ravel()[old])
    kept = len(distinct(pairs % vertices))
    return len(pairs) - kept, len(pairs) - len(distinct(given[old])) + int(vertices) - kept
