"""What the cube layout asks of a surface: closed, one part, no handles. Refusals come with numbers and places."""

from __future__ import annotations

import numpy as np

from ..errors import MeshError
from .counting import counted, place
from .mesh import Mesh

# A surface that encloses less, relative to the cube of its size, has no inside.
_FLAT = 1e-12
# Parts beyond which a surface round all of them serves better than each by itself.
_MANY_PARTS = 100


def many_parts(mesh: Mesh) -> str:
    """Advice for a mesh of very many parts; none, "", for others."""
    parts = mesh.component_count
    return f"wrap (--wrap) would put one closed surface round its {parts:,} parts" if parts > _MANY_PARTS else ""


def check_genus_zero(mesh: Mesh) -> None:
    """Raise `MeshError`, naming every defect, unless the mesh is a closed surface of genus 0 in one part."""
    defects, advice = [], ""
    parts = mesh.component_count
    if parts > 1:
        defects.append(f"in {parts:,} separate parts (valid is one; keep the part you want, or join them)")
    if not mesh.closed:
        edges = sum(len(rim) for rim in mesh.rims)
        near = place(mesh.V[mesh.rims[0][:2]].mean(axis=0))
        defects.append(
            f"open: {counted(edges, 'boundary edge')} round {counted(len(mesh.rims), 'hole')} (one near {near})"
        )
        advice = "; repair (--repair) closes holes"
    handles = int(mesh.genus.sum())
    if parts == 1 and handles:
        defects.append(f"of genus {handles} (valid is genus 0: no handles or tunnels)")
    if many_parts(mesh):
        advice = f"; {many_parts(mesh)}"
    if defects:
        cuts = "".join(f"; {note}" for note in mesh.notes if note.startswith("cut "))
        raise MeshError(f"{mesh.name} is not a closed genus-0 surface: it is {', and '.join(defects)}{cuts}{advice}")
    extent = np.ptp(mesh.V, axis=0).max()
    if not abs(mesh.volume) > _FLAT * extent**3:
        raise MeshError(
            f"{mesh.name} is degenerate: it encloses no volume ({mesh.volume:.3g} m^3 at a size of {extent:.3g} m)"
        )
