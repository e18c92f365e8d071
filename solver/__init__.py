"""Surface waves on genus-0 meshes: mesh -> sphere map -> atlas -> operator -> waves. Knows nothing of MuJoCo.

The public names load their modules when they are first used, so that importing this package is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .absorber import absorbing_damping
    from .analytic import SphereAtlas, sphere_atlas
    from .atlas import Atlas
    from .atlas_file import load_atlas
    from .build import build_atlas
    from .errors import AtlasError, GLError, MeshError, RippleError, SolverError, SphereMapError
    from .footprint import Footprint
    from .maps import texture_map, vertex_map
    from .material import Material
    from .mesh import Mesh
    from .mesh_file import load_mesh
    from .relief import Relief
    from .waves import WaveSolver

_HOME = {
    "Atlas": "atlas",
    "AtlasError": "errors",
    "Footprint": "footprint",
    "GLError": "errors",
    "Material": "material",
    "Mesh": "mesh",
    "MeshError": "errors",
    "Relief": "relief",
    "RippleError": "errors",
    "SolverError": "errors",
    "SphereAtlas": "analytic",
    "SphereMapError": "errors",
    "WaveSolver": "waves",
    "absorbing_damping": "absorber",
    "build_atlas": "build",
    "load_atlas": "atlas_file",
    "load_mesh": "mesh_file",
    "sphere_atlas": "analytic",
    "texture_map": "maps",
    "vertex_map": "maps",
}

__all__ = [
    "Atlas",
    "AtlasError",
    "Footprint",
    "GLError",
    "Material",
    "Mesh",
    "MeshError",
    "Relief",
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
