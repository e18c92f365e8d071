"""The surface of a target as a mesh, and its atlas, in the geom's own frame.

Meshes are MuJoCo's own; height fields and primitive geoms are cut into triangles.
"""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.scenes.sphere_maps import shipped_sphere_map
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.cache import ResultCache, content_key
from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.mesh.clean import counted

from .geoms import TARGET_TYPES, geom_name
from .ids import GeomId, TargetId, is_geom
from .soft import SoftSurface

# Longest edge of a triangle over the size of the primitive.
_LONGEST_EDGE = 1 / 24

# Sides of a cylinder.
_CYLINDER_SIDES = 96

# Subdivisions of an icosahedron for a sphere or an ellipsoid.
_SPHERE_SUBDIVISIONS = 4

# Sides of a capsule along and around its caps.
_CAPSULE_SIDES = (48, 48)

# Number of atlases that are kept, and the largest number of texels of each: 20 MB.
_KEPT_ATLASES = 4
_MAX_KEPT_TEXELS = 100_000

_atlases: ResultCache[Atlas] = ResultCache(
    _KEPT_ATLASES, lambda atlas: atlas.areas.size <= _MAX_KEPT_TEXELS
)


def height_field_triangles(
    model: mujoco.MjModel, field: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], and triangles, [m, 3], of the top of a height field.

    The vertices are in the frame of its geom, and the triangles face up. The cells are cut along
    the diagonal along which MuJoCo cuts them into prisms (`mjc_ConvexHField`).
    """
    rows = int(model.hfield_nrow[field])
    columns = int(model.hfield_ncol[field])
    first = int(model.hfield_adr[field])
    size = model.hfield_size[field]
    x, y = np.meshgrid(
        np.linspace(-size[0], size[0], columns), np.linspace(-size[1], size[1], rows)
    )
    z = size[2] * model.hfield_data[first : first + rows * columns].astype(np.float64)
    number = np.arange(rows * columns).reshape(rows, columns)
    south_west = number[:-1, :-1].ravel()
    south_east = number[:-1, 1:].ravel()
    north_west = number[1:, :-1].ravel()
    north_east = number[1:, 1:].ravel()
    F = [
        np.stack([south_west, south_east, north_east], axis=1),
        np.stack([south_west, north_east, north_west], axis=1),
    ]
    return np.stack([x.ravel(), y.ravel(), z], axis=1), np.concatenate(F)


def primitive_triangles(
    kind: str, size: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], on a primitive geom of a MuJoCo size, [3], and triangles, [m, 3]."""
    if kind == "sphere":
        kind = "ellipsoid"
        size = np.full(3, size[0])
    # trimesh merges vertices within a fixed distance: triangles are made at a size of about 1
    scale = 2.0 ** np.floor(np.log2(size.max()))
    size = size / scale
    if kind == "ellipsoid":
        solid = trimesh.creation.icosphere(subdivisions=_SPHERE_SUBDIVISIONS)
        solid.apply_scale(size)
    elif kind == "capsule":
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=_CAPSULE_SIDES)
        solid.apply_translation([0, 0, -solid.bounds.mean(axis=0)[2]])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(
            radius=size[0], height=2 * size[1], sections=_CYLINDER_SIDES
        )
    else:
        solid = trimesh.creation.box(extents=2 * size)
    longest = float(np.max(solid.extents)) * _LONGEST_EDGE
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=longest)
    # vertices of a round solid move along the radius from its chords onto its surface
    if kind == "ellipsoid":
        V = V / np.linalg.norm(V / size, axis=1, keepdims=True)
    elif kind == "capsule":
        axis = np.clip(V[:, 2:], -size[1], size[1]) * [0.0, 0.0, 1.0]
        V = axis + size[0] * (V - axis) / np.linalg.norm(V - axis, axis=1, keepdims=True)
    elif kind == "cylinder":
        radius = np.linalg.norm(V[:, :2], axis=1)
        # the other vertices lie inside the flat ends
        on_side = radius > size[0] * (np.cos(np.pi / _CYLINDER_SIDES) - 1e-9)
        V[on_side, :2] *= (size[0] / radius[on_side])[:, None]
    return scale * V, F


def target_atlas(
    model: mujoco.MjModel, target: TargetId, resolution: int, layout: str = "auto"
) -> Atlas:
    """Atlas of a target's surface [m], in a layout of `build_atlas`.

    It is in the geom's frame; the atlas of a flex or a skin is in the world.

    Raises
    ------
    MeshError
        If the geom's mesh does not suit the layout.
    AtlasError
        If no charts can be laid on it, as where it is a heap of thin loose pieces.
    """
    if not is_geom(target, model):
        return build_atlas(SoftSurface(model, target).mesh, resolution, layout=layout)
    if TARGET_TYPES[int(model.geom_type[target])] == "sphere" and layout != "patches":
        radius = float(model.geom_size[target, 0])
        return _atlases.get(
            f"sphere {radius!r} {resolution}", lambda: sphere_atlas(radius, resolution)
        )
    V, F, uv, name = _surface(model, target)
    key = content_key(f"{resolution} {layout}", [V, F, np.zeros(0) if uv is None else uv])

    def build() -> Atlas:
        mesh = Mesh.from_arrays(V, F, uv, name)
        try:
            return build_atlas(mesh, resolution, layout=layout, sphere=shipped_sphere_map(mesh))
        except AtlasError as error:
            raise AtlasError(
                f"{name}, in {counted(mesh.component_count, 'part')}, gets no charts: {error}; let "
                "the geom that collides for it ripple, or give it a mesh that is wrapped: "
                "load_mesh(file, wrap=True)"
            ) from error

    return _atlases.get(key, build)


def target_mesh(model: mujoco.MjModel, geom: GeomId) -> Mesh:
    """Surface of a geom in the geom's frame [m]; see `target_atlas`."""
    return Mesh.from_arrays(*_surface(model, geom))


def _surface(model: mujoco.MjModel, geom: GeomId) -> tuple[NDArray, NDArray, NDArray | None, str]:
    """The arguments of `Mesh.from_arrays`: vertices, triangles, texture coordinates, name."""
    kind = TARGET_TYPES[int(model.geom_type[geom])]
    asset = int(model.geom_dataid[geom])
    name = f"mesh of geom {geom_name(model, geom)!r}"
    if kind == "hfield":
        V, F = height_field_triangles(model, asset)
        return V, F, None, name
    if kind not in ("mesh", "sdf"):
        V, F = primitive_triangles(kind, model.geom_size[geom])
        return V, F, None, name
    V, F, uv = mesh_arrays(model, asset)
    if uv is not None:
        # `Mesh` counts v from the lower edge of the image
        uv = np.stack([uv[..., 0], 1 - uv[..., 1]], axis=-1)
    return V, F, uv, name


def mesh_arrays(
    model: mujoco.MjModel, mesh: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64] | None]:
    """Vertices [m], [n, 3], triangles, [m, 3], and texture coordinates of a mesh asset.

    Texture coordinates are those of the triangles' corners, [m, 3, 2], with v counted from the
    upper edge of the image; None if the mesh has none.
    """
    first_face = model.mesh_faceadr[mesh]
    faces = slice(first_face, first_face + model.mesh_facenum[mesh])
    first_vertex = model.mesh_vertadr[mesh]
    V = model.mesh_vert[first_vertex:][: model.mesh_vertnum[mesh]].astype(np.float64)
    F = model.mesh_face[faces].astype(np.int64)
    first_uv = model.mesh_texcoordadr[mesh]
    if first_uv < 0:
        return V, F, None
    uv = model.mesh_texcoord[first_uv + model.mesh_facetexcoord[faces]].astype(np.float64)
    return V, F, uv
