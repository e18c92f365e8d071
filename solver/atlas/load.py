"""Atlases from files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from numpy.typing import NDArray

from ripple_sim.solver.checked import PATH, checked
from ripple_sim.solver.cube_map.cube_chart_map import CubeChartMap
from ripple_sim.solver.cube_map.sphere_atlas import SphereAtlas
from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.patches.patch_chart_map import PatchChartMap
from ripple_sim.solver.patches.pieces import Pieces
from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.atlas_file import ADVICE, read_atlas_file
from ripple_sim.solver.texels.chart_map import ChartMap
from ripple_sim.solver.texels.glue import glue
from ripple_sim.solver.texels.linear_chart_map import LinearChartMap
from ripple_sim.solver.texels.texel_mesh import TexelMesh

Arrays = dict[str, NDArray]

_CHART_MAPS: dict[str, Callable[[Arrays], ChartMap]] = {
    "cube": lambda arrays: CubeChartMap(arrays["sphere"]),
    "patches": lambda arrays: PatchChartMap(Pieces(*(arrays[f"piece_{name}"] for name in Pieces._fields))),
    "given": lambda arrays: LinearChartMap(arrays["charts"], arrays["corners"], arrays["positions"].shape[1]),
}


@checked(AtlasError, path=PATH)
def load_atlas(path: str | Path) -> Atlas:
    """Read an atlas written by `Atlas.save`.

    Raises
    ------
    AtlasError
        If the file is missing, truncated, changed, or not an atlas of this version.
    """
    arrays = read_atlas_file(Path(path))
    kind, layout = arrays["kind"].tolist()
    try:
        chart_map = _CHART_MAPS[layout](arrays)
    except KeyError as error:
        raise AtlasError(f"atlas file {str(path)!r} lacks {error} or is of another layout; {ADVICE}") from error
    topology = glue(arrays["glued"], arrays["positions"].shape[1])
    return (SphereAtlas if kind == SphereAtlas.__name__ else Atlas)(
        mesh=Mesh(arrays["V"], arrays["F"], arrays.get("uv"), arrays.get("corner_uv")),
        texels=TexelMesh(topology, arrays["positions"], arrays["normals"], arrays["areas"], arrays.get("beyond")),
        chart_map=chart_map,
        triangles=arrays["triangles"],
        barycentrics=arrays["barycentrics"],
    )
