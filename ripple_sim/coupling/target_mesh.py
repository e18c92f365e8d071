"""The surface of a target as a mesh, and its atlas, in the geom's own frame."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.scenes.sphere_maps import shipped_sphere_map
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.cache import Kept, content_key

from .geoms import TARGET_TYPES, geom_name
from .height_fields import height_field_triangles
from .primitives import primitive_triangles
from .soft import SoftSurface
from .soft_ids import is_soft

_MOST_TEXELS = 100_000  # of an atlas that is kept: 20 MB

_kept: Kept[Atlas] = Kept(4, lambda atlas: atlas.areas.size <= _MOST_TEXELS)


def target_atlas(model: mujoco.MjModel, geom: int, resolution: int, layout: str = "auto") -> Atlas:
    """Atlas of a geom's surface in the geom's frame [m], in a layout of `build_atlas`; of what is soft in the world.

    Raises
    ------
    MeshError
        If the geom's mesh does not suit the layout.
    """
    if is_soft(model, geom):
        return build_atlas(SoftSurface(model, geom).mesh, resolution, layout=layout)
    if TARGET_TYPES[int(model.geom_type[geom])] == "sphere" and layout != "patches":
        radius = float(model.geom_size[geom, 0])
        return _kept.get(f"sphere {radius!r} {resolution}", lambda: sphere_atlas(radius, resolution))
    V, F, uv, name = _surface(model, geom)
    key = content_key(f"{resolution} {layout}", [V, F, np.zeros(0) if uv is None else uv])

    def build() -> Atlas:
        mesh = Mesh.from_arrays(V, F, uv, name)
        return build_atlas(mesh, resolution, layout=layout, sphere=shipped_sphere_map(mesh))

    return _kept.get(key, build)


def target_mesh(model: mujoco.MjModel, geom: int) -> Mesh:
    """Surface of a geom in the geom's frame [m]; see `target_atlas`."""
    return Mesh.from_arrays(*_surface(model, geom))


def _surface(model: mujoco.MjModel, geom: int) -> tuple[NDArray, NDArray, NDArray | None, str]:
    """What `Mesh.from_arrays` takes: vertices, triangles, texture coordinates, name."""
    kind = TARGET_TYPES[int(model.geom_type[geom])]
    name = f"mesh of geom {geom_name(model, geom)!r}"
    if kind == "hfield":
        return *height_field_triangles(model, int(model.geom_dataid[geom])), None, name
    if kind not in ("mesh", "sdf"):
        return *primitive_triangles(kind, model.geom_size[geom]), None, name
    mesh = model.geom_dataid[geom]
    first_vertex, first_triangle = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    V = model.mesh_vert[first_vertex : first_vertex + model.mesh_vertnum[mesh]]
    F = model.mesh_face[first_triangle : first_triangle + model.mesh_facenum[mesh]]
    return V, F, _texture_coordinates(model, mesh), name


def _texture_coordinates(model: mujoco.MjModel, mesh: int) -> NDArray[np.float64] | None:
    """A mesh's own texture coordinates at the corners of its triangles, [triangle_count, 3, 2], or None.

    MuJoCo counts v from the upper edge of the image.
    """
    first, first_triangle = model.mesh_texcoordadr[mesh], model.mesh_faceadr[mesh]
    if first < 0:
        return None
    pairs = model.mesh_texcoord[first : first + model.mesh_texcoordnum[mesh]]
    corners = model.mesh_facetexcoord[first_triangle : first_triangle + model.mesh_facenum[mesh]]
    uv = pairs[corners].astype(np.float64)
    return np.stack([uv[..., 0], 1 - uv[..., 1]], axis=-1)
