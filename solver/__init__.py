"""Surface waves on meshes: mesh -> layout -> atlas -> operator -> waves. Knows nothing of MuJoCo.

The public names load their modules when they are first used, so that importing this package is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .errors import AtlasError, GLError, MeshError, RippleError, SolverError, SphereMapError
    from .layouts.build import build_atlas, load_atlas
    from .layouts.cube.atlas import SphereAtlas, sphere_atlas
    from .mesh.files import load_mesh
    from .mesh.mesh import Mesh
    from .mesh.volume import Volume, load_volume
    from .mesh.wrap import Wrap, wrap
    from .operator.assembly import build_operator
    from .operator.material import Material
    from .operator.regions import absorbing_damping, hold
    from .texels.atlas import Atlas
    from .texels.maps import texture_map, vertex_map
    from .texels.texel_atlas import texel_atlas
    from .texels.texel_mesh import TexelMesh
    from .texels.thickness import thickness_map
    from .texels.topology import TexelTopology, glue
    from .waves.footprint import Footprint
    from .waves.height_map import HeightMap
    from .waves.load import Load
    from .waves.wave_solver import WaveSolver

_HOME = {
    "Atlas": "texels.atlas",
    "AtlasError": "errors",
    "Footprint": "waves.footprint",
    "GLError": "errors",
    "Load": "waves.load",
    "Material": "operator.material",
    "Mesh": "mesh.mesh",
    "MeshError": "errors",
    "HeightMap": "waves.height_map",
    "RippleError": "errors",
    "SolverError": "errors",
    "SphereAtlas": "layouts.cube.atlas",
    "SphereMapError": "errors",
    "TexelMesh": "texels.texel_mesh",
    "TexelTopology": "texels.topology",
    "Volume": "mesh.volume",
    "WaveSolver": "waves.wave_solver",
    "Wrap": "mesh.wrap",
    "absorbing_damping": "operator.regions",
    "build_atlas": "layouts.build",
    "build_operator": "operator.assembly",
    "glue": "texels.topology",
    "hold": "operator.regions",
    "load_atlas": "layouts.build",
    "load_mesh": "mesh.files",
    "load_volume": "mesh.volume",
    "sphere_atlas": "layouts.cube.atlas",
    "texel_atlas": "texels.texel_atlas",
    "texture_map": "texels.maps",
    "thickness_map": "texels.thickness",
    "vertex_map": "texels.maps",
    "wrap": "mesh.wrap",
}

__all__ = [
    "Atlas",
    "AtlasError",
    "Footprint",
    "GLError",
    "HeightMap",
    "Load",
    "Material",
    "Mesh",
    "MeshError",
    "RippleError",
    "SolverError",
    "SphereAtlas",
    "SphereMapError",
    "TexelMesh",
    "TexelTopology",
    "Volume",
    "WaveSolver",
    "Wrap",
    "absorbing_damping",
    "build_atlas",
    "build_operator",
    "glue",
    "hold",
    "load_atlas",
    "load_mesh",
    "load_volume",
    "sphere_atlas",
    "texel_atlas",
    "texture_map",
    "thickness_map",
    "vertex_map",
    "wrap",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; valid are {', '.join(__all__)}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
