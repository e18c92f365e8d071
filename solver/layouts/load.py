"""Atlases from files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from numpy.typing import NDArray

from ..checked import PATH, checked
from ..errors import AtlasError
from ..mesh.mesh import Mesh
from ..texels.atlas import Atlas
from ..texels.atlas_file import ADVICE, read_atlas_file
from ..texels.chart_map import ChartMap
from ..texels.glue import glue
from ..texels.linear_chart_map import LinearChartMap
from ..texels.texel_mesh import TexelMesh
from .cube.atlas import SphereAtlas
from .cube.cube_chart_map import CubeChartMap
from .patches.atlas import PatchChartMap
from .patches.pieces import Pieces

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
