"""Warnings of targets whose contacts are missing or wrong.

Nothing can touch such a target, or it collides off the surface that ripples, or MuJoCo reports no
forces of its contacts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import igl
import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .geoms import TARGET_TYPES
from .ids import GeomId
from .model import CoupledModel, flex_thickness
from .target_mesh import mesh_arrays, primitive_triangles

_GEOM = mujoco.mjtGeom

# Advice for open meshes: only a closed mesh collides as a signed distance.
CLOSED_ADVICE = "a closed mesh (repair=True of load_mesh, --repair of the command)"

# Largest number of points of the rippling surface at which its distance is measured.
_GAP_POINTS = 1500

# A collision surface that is off the true surface by this share of the target's size shows: bodies
# stop in mid-air.
GAP_TOLERANCE = 0.02

# The same share for geoms that were made to collide in place of a finer one.
COARSE_TOLERANCE = 0.1


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m].

    It is measured at points of the hull that are 1/24 of its size apart.
    """
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(
        hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24
    )
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def collision_gap(
    coupled: CoupledModel, target: GeomId, atlas: Atlas, geoms: Iterable[GeomId]
) -> float:
    """Distance of a target's surface from the geoms that collide for it [m].

    It is how deep bodies sink into the surface before they meet these geoms, or how far above the
    surface they are held, whichever is more. The latter is the median over the surface, since a
    part of it may well lie inside a geom that collides for the target's neighbour too.

    Parameters
    ----------
    coupled : CoupledModel
    target : GeomId
    atlas : Atlas
        Of the target.
    geoms : iterable of GeomId
        Geoms on its body or on bodies welded to it. Planes and height fields have no surface
        to be off from.
    """
    model = coupled.model
    data = mujoco.MjData(coupled.model)
    mujoco.mj_kinematics(model, data)
    solids = [
        geom for geom in geoms if TARGET_TYPES.get(int(model.geom_type[geom]), "hfield") != "hfield"
    ]
    if not solids:
        return 0.0
    positions = atlas.positions.reshape(-1, 3)
    stride = -(-len(positions) // _GAP_POINTS)
    rotation = data.geom_xmat[target].reshape(3, 3)
    points = data.geom_xpos[target] + positions[::stride] @ rotation.T
    # from the nearest solid, negative inside [m]
    distances = np.full(len(points), np.inf)
    for geom in solids:
        V, F = _collision_surface(coupled, geom)
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        distances = np.minimum(distances, igl.signed_distance(local, V, F)[0])
    return float(max(distances.max(), -np.median(distances)))


def _collision_surface(
    coupled: CoupledModel, geom: GeomId
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], and triangles, [m, 3], of the surface with which a geom collides."""
    model = coupled.model
    kind = TARGET_TYPES[int(model.geom_type[geom])]
    if kind not in ("mesh", "sdf"):
        return primitive_triangles(kind, model.geom_size[geom])
    V, F, _ = mesh_arrays(model, int(model.geom_dataid[geom]))
    if kind == "sdf" or coupled.has_flex[geom]:
        return V, F
    hull = trimesh.convex.convex_hull(V)
    return np.array(hull.vertices), np.array(hull.faces)


def collision_warnings(coupled: CoupledModel, geom: GeomId, atlas: Atlas) -> Iterator[str]:
    """Warnings of a target whose contacts are missing or wrong.

    Nothing can touch it, it collides off its surface, or MuJoCo reports no forces of its contacts.
    """
    model = coupled.model
    solids = coupled.collision_geoms(geom)
    collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
    if coupled.out_of_touch(geom):
        yield _touch_warning(coupled, geom)
    elif geom in coupled.convex_colliders or any(solid != geom for solid in solids):
        yield from _collider_warning(coupled, geom, atlas)
    elif coupled.has_flex[geom]:
        yield from _flex_warning(coupled, geom, atlas)
    elif model.geom_type[geom] == _GEOM.mjGEOM_MESH and collides:
        yield from _hull_warning(coupled, geom, atlas)
    elif model.geom_type[geom] == _GEOM.mjGEOM_SDF:
        yield from _sdf_warning(coupled, geom)
    # MuJoCo's older versions have no passive contacts
    is_passive = getattr(model, "flex_passive", np.zeros(model.nflex))
    for flex in coupled.soft_flexes(geom).tolist():
        if is_passive[flex]:
            yield (
                "MuJoCo tells no forces of the passive contacts of flex "
                f"{coupled.names[model.ngeom + flex]!r}, under which geom {coupled.names[geom]!r} "
                'will not ripple; set passive="false" in the flex\'s <contact>'
            )


def _collider_warning(coupled: CoupledModel, geom: GeomId, atlas: Atlas) -> Iterator[str]:
    """Warning of a target for which other geoms collide, off its surface."""
    name = coupled.names[geom]
    size = _size(atlas)
    colliders: list[GeomId] = []
    for solid in coupled.collision_geoms(geom):
        colliders += coupled.convex_colliders.get(solid, [solid])
    gap = collision_gap(coupled, geom, atlas, colliders)
    if gap > COARSE_TOLERANCE * size:
        names = ", ".join(repr(coupled.names[collider]) for collider in colliders)
        yield (
            f"geom {name!r} collides as {names}, up to {gap:.3g} m ({gap / size:.0%} of its size) "
            "off the surface that ripples: contacts load it where it is nearest to them; name "
            f"other geoms in Target(contacts=...) or call make_collidable(spec, {name!r})"
        )


def _hull_warning(coupled: CoupledModel, geom: GeomId, atlas: Atlas) -> Iterator[str]:
    """Warning of a mesh geom whose convex hull is off its surface."""
    name = coupled.names[geom]
    size = _size(atlas)
    gap = hull_gap(atlas)
    if gap > GAP_TOLERANCE * size:
        yield (
            f"geom {name!r} collides as its convex hull, up to {gap:.3g} m ({gap / size:.0%} "
            'of its size) off the surface that ripples; give it type="sdf" in the MJCF, or '
            f"call make_collidable(spec, {name!r})"
        )


def _sdf_warning(coupled: CoupledModel, geom: GeomId) -> Iterator[str]:
    """Warning of height fields that an SDF geom does not meet."""
    name = coupled.names[geom]
    is_field = coupled.model.geom_type == _GEOM.mjGEOM_HFIELD
    fields = np.flatnonzero(coupled.can_collide(geom) & is_field)
    if len(fields):
        names = ", ".join(repr(coupled.names[field]) for field in fields)
        yield (
            f"MuJoCo finds no contacts of the SDF geom {name!r} with height fields ({names}): "
            f'call make_collidable(spec, {name!r}, "flex"), or choose contype and conaffinity '
            "so that they do not meet"
        )


def _size(atlas: Atlas) -> float:
    """Longest extent of a target along the axes of its frame [m]."""
    return float(np.ptp(atlas.mesh.V, axis=0).max())


def _touch_warning(coupled: CoupledModel, geom: GeomId) -> str:
    """Warning of a target that nothing can touch."""
    model = coupled.model
    name = coupled.names[geom]
    colliders = coupled.collision_geoms(geom)
    if not colliders:
        return (
            f"nothing can touch geom {name!r}: it does not collide (contype and conaffinity are "
            "0), nor does another geom of its body; name the geoms that collide for it, "
            "Target(contacts=[...]), or give it a contype"
        )
    settings = []
    for collider in colliders:
        contype = model.geom_contype[collider]
        conaffinity = model.geom_conaffinity[collider]
        settings.append(
            f"{coupled.names[collider]!r} has contype {contype} and conaffinity {conaffinity}"
        )
    masks = ", ".join(settings)
    return (
        f"nothing can touch geom {name!r}: {masks}, which match no geom of a body that is not "
        "welded to its own"
    )


def _flex_warning(coupled: CoupledModel, geom: GeomId, atlas: Atlas) -> Iterator[str]:
    """Warning of geoms that a flex collider meets badly, or not at all."""
    model = coupled.model
    name = coupled.names[geom]
    meets = coupled.can_collide(geom)
    thickness = flex_thickness(model, coupled.flex_colliders[geom])
    reasons = {
        "MuJoCo may throw boxes ({}) aside, with impulses off by a tenth, though not box-shaped "
        "meshes": model.geom_type == _GEOM.mjGEOM_BOX,
        f"SDF geoms ({{}}) sink {thickness:.2g} m into it before they are pushed out": (
            model.geom_type == _GEOM.mjGEOM_SDF
        ),
        "MuJoCo finds no contacts of a flex with bodies that are joined to its own or excluded "
        "({})": _passing(model, int(model.geom_bodyid[geom])),
    }
    problems = []
    for reason, concerned in reasons.items():
        names = [repr(coupled.names[other]) for other in np.flatnonzero(concerned & meets)]
        if names:
            problems.append(reason.format(", ".join(names)))
    if problems:
        other_route = f'call make_collidable(spec, {name!r}, "sdf")'
        if not atlas.mesh.closed:
            other_route = f"take {CLOSED_ADVICE}"
        yield (
            f"geom {name!r} collides through a flex: {'; '.join(problems)}; {other_route}, or "
            "choose shapes, contype and conaffinity so that they do not meet"
        )


def _passing(model: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """Geoms, [ngeom], that MuJoCo lets pass through a body's flex.

    Their bodies are joined to the body, or excluded by name.
    """
    weld = model.body_weldid
    parent = weld[model.body_parentid[weld]]
    joined = (parent == weld[body]) | (parent[body] == weld)
    joined &= (weld != weld[body]) & (weld != 0) & bool(weld[body])
    joined &= not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    # the two bodies of an exclusion are in the upper and lower half of its signature
    excluded = np.column_stack([model.exclude_signature >> 16, model.exclude_signature & 0xFFFF])
    joined[excluded[(excluded == body).any(axis=1)]] = True
    return joined[model.geom_bodyid] & (model.geom_bodyid != body)
