"""Open and non-manifold meshes mended, on request, by pymeshfix (Attene 2010, a package of its own under the GPL)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import MeshError
from .mesh import Mesh

_INSTALL = "pip install 'ripple-sim[repair]' (it adds the package pymeshfix, which is under the GPL)"


def repaired(V: NDArray[np.float64], F: NDArray[np.int64], name: str, defect: MeshError) -> Mesh:
    """Fill holes, cut away what is not manifold, keep the largest part, and validate the result.

    Texture coordinates do not survive. Handles and tunnels stay as they are.

    Parameters
    ----------
    V, F : [vertex_count, 3], [face_count, 3]
        The surface as it was found.
    name : str
        What to call it in messages.
    defect : MeshError
        Why it was refused.

    Raises
    ------
    MeshError
        If pymeshfix is not installed, or the mended surface is refused too.
    """
    try:
        from pymeshfix import PyTMesh
    except ImportError as error:
        raise MeshError(f"{defect}; for --repair, run {_INSTALL}") from error
    F = F[np.isfinite(V[F]).all(axis=(1, 2))]
    if len(F) == 0:
        raise MeshError(f"{defect}; nothing is left to repair")
    corners, inverse = np.unique(V[F].reshape(-1, 3), axis=0, return_inverse=True)
    try:
        fixer = PyTMesh()
        fixer.set_quiet(True)
        fixer.load_array(corners, inverse.reshape(-1, 3).astype(np.int32))
        fixer.fill_small_boundaries(nbe=0, refine=True)
        fixer.remove_smallest_components()
        fixer.clean(max_iters=10, inner_loops=3)
        mesh = Mesh.from_arrays(*fixer.return_arrays(), name="it")
    except Exception as error:  # pymeshfix has no error type of its own
        raise MeshError(f"{defect}; pymeshfix cannot repair that ({' '.join(str(error).split())})") from error
    said = f"repaired by pymeshfix: {len(F)} triangles became {len(mesh.F)}, texture coordinates dropped ({defect})"
    return Mesh(mesh.V, mesh.F, fixes=(said, *mesh.fixes))
