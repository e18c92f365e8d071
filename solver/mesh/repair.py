"""Open and non-manifold meshes mended, on request, by pymeshfix (Attene 2010, a package of its own under the GPL)."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import MeshError

from .mesh import Mesh

_INSTALL = "pip install 'ripple-sim[repair]' (it adds the package pymeshfix, which is under the GPL)"
_TIME_LIMIT = 120  # [s]; a hundred thousand triangles take a few, hopeless cases hours


def repaired(V: NDArray[np.float64], F: NDArray[np.int64], name: str, defect: MeshError) -> Mesh:
    """Fill holes, cut away non-manifold parts, keep the largest part, and validate the result.

    Texture coordinates do not survive. Handles and tunnels stay as they are.

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
        The surface as given.
    name : str
        Its name in messages.
    defect : MeshError
        Why it was refused.

    Raises
    ------
    MeshError
        If pymeshfix is not installed, or the mended surface is refused too.
    """
    if importlib.util.find_spec("pymeshfix") is None:
        raise MeshError(f"{defect}; for --repair, run {_INSTALL}")
    F = F[np.isfinite(V[F]).all(axis=(1, 2))]
    if len(F) == 0:
        raise MeshError(f"{defect}; nothing is left to repair")
    corners, inverse = np.unique(V[F].reshape(-1, 3), axis=0, return_inverse=True)
    try:
        mesh = Mesh.from_arrays(*_mended(corners, inverse.reshape(-1, 3)), name=name)
    except MeshError as error:
        reason = str(error).removeprefix(f"{defect}").removeprefix(f"{name} ")
        raise MeshError(f"{defect}; pymeshfix cannot repair that{f' ({reason})' if reason else ''}") from error
    said = f"repaired by pymeshfix: {len(F)} triangles became {len(mesh.F)}, texture coordinates dropped ({defect})"
    return Mesh(mesh.V, mesh.F, fixes=(said, *mesh.fixes))


def _mended(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "source.npz", Path(folder) / "target.npz"
        np.savez(source, V=V, F=F)
        # -P: modules beside the program must not hide the standard library's
        program = [sys.executable, "-P", str(Path(__file__).with_name("meshfix.py")), str(source), str(target)]
        try:
            subprocess.run(program, check=True, capture_output=True, stdin=subprocess.DEVNULL, timeout=_TIME_LIMIT)
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"it did not finish within {_TIME_LIMIT} s") from error
        except (OSError, subprocess.CalledProcessError) as error:
            raise MeshError("it failed") from error
        with np.load(target) as arrays:
            V, F = arrays["V"], arrays["F"].astype(np.int64)
    if len(F) == 0:
        raise MeshError("nothing was left")
    return V, F
