"""Surface waves on genus-0 meshes: mesh -> sphere map -> atlas -> operator -> waves. Knows nothing of MuJoCo.

The public names load their modules when they are first used, so that importing this package is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .errors import AtlasError, GLError, MeshError, RippleError, SolverError, SphereMapError
    from .mesh.mesh import Mesh
    from .mesh.mesh_file import load_mesh
    from .texels.atlas import Atlas
    from .texels.atlas_file import load_atlas
    from .texels.build import build_atlas
    from .texels.cube_map.sphere_atlas import SphereAtlas, sphere_atlas
    from .texels.maps import texture_map, vertex_map
    from .waves.absorbing import absorbing_damping
    from .waves.footprint import Footprint
    from .waves.height_map import HeightMap
    from .waves.load import Load
    from .waves.material import Material
    from .waves.wave_solver import WaveSolver

_HOME = {
    "Atlas": "texels.atlas",
    "AtlasError": "errors",
    "Footprint": "waves.footprint",
    "GLError": "errors",
    "Load": "waves.load",
    "Material": "waves.material",
    "Mesh": "mesh.mesh",
    "MeshError": "errors",
    "HeightMap": "waves.height_map",
    "RippleError": "errors",
    "SolverError": "errors",
    "SphereAtlas": "texels.cube_map.sphere_atlas",
    "SphereMapError": "errors",
    "WaveSolver": "waves.wave_solver",
    "absorbing_damping": "waves.absorbing",
    "build_atlas": "texels.build",
    "load_atlas": "texels.atlas_file",
    "load_mesh": "mesh.mesh_file",
    "sphere_atlas": "texels.cube_map.sphere_atlas",
    "texture_map": "texels.maps",
    "vertex_map": "texels.maps",
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
    "WaveSolver",
    "absorbing_damping",
    "build_atlas",
    "load_atlas",
    "load_mesh",
    "sphere_atlas",
    "texture_map",
    "vertex_map",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; valid are {', '.join(__all__)}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
