"""Triangle meshes: manifold, oriented surfaces made from any triangle soup, and their normals.

The cube layout asks more of a surface: closed, one part, no handles. Refusals come with numbers and
places.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MeshError
from .clean import (
    Corners,
    collapsed,
    counted,
    distinct_triangles,
    merged_vertices,
    oriented,
    part_volumes,
    place,
    without_slivers,
)
from .looks import Looks
from .sheets import cut_apart
from .topology import (
    corner_angles,
    distinct,
    labels,
    normalized,
    sides_of,
    triangle_areas,
    triangle_normals,
    triangles_beside,
)

# Cosine between a vertex's normal and the normal of a triangle beside it, below which a better
# direction is searched for.
_MIN_NORMAL_COSINE = 0.1

# Steps of that search; the error falls as one over the number of steps.
_NORMAL_STEPS = 300

# Smallest and largest size of a mesh [m]: squares and cubes of lengths between them are far from
# the limits of float64.
_MIN_SIZE = 1e-12
_MAX_SIZE = 1e12

# A surface that encloses less, in units of the cube of its size, has no inside.
_MIN_ENCLOSED_VOLUME = 1e-12

# Parts above which one surface round all of them serves better than a surface for each part.
_MANY_PARTS = 100


def vertex_normals(V: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals weighted by corner angle, shape [n, 3] (Thuermer and Wuethrich 1998).

    At tips and knife edges the weighted mean may point into a triangle. There the normal becomes
    the direction whose largest angle to a triangle's normal is least (Aubry and Loehner 2008), if
    it is better.
    """
    triangle_normal = triangle_normals(V, F)
    normal = _angle_weighted(V, F, triangle_normal)
    vertex = F.ravel()
    triangle = np.repeat(np.arange(len(F)), 3)
    worst_cosine = _worst_cosines(normal, vertex, triangle_normal[triangle])
    steep = np.flatnonzero(worst_cosine < _MIN_NORMAL_COSINE)
    if not len(steep):
        return normal
    is_steep = np.isin(vertex, steep)
    steep_vertex = np.searchsorted(steep, vertex[is_steep])
    normals_beside = triangle_normal[triangle[is_steep]]
    middle = _cap_middles(normal[steep], steep_vertex, normals_beside)
    worst_of_middle = _worst_cosines(middle, steep_vertex, normals_beside)
    better = worst_of_middle > worst_cosine[steep]
    normal[steep[better]] = middle[better]
    return normal


def _angle_weighted(
    V: NDArray[np.float64], F: NDArray[np.int64], triangle_normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean of the normals [m, 3] of the triangles at each vertex, by their angles there, [n, 3].

    Up, where the normals cancel each other.
    """
    total = np.zeros_like(V)
    for k, angle in enumerate(corner_angles(V, F).T):
        for axis in range(3):
            weights = angle * triangle_normal[:, axis]
            total[:, axis] += np.bincount(F[:, k], weights=weights, minlength=len(V))
    has_mean = np.linalg.norm(total, axis=1, keepdims=True) > 0
    return np.where(has_mean, normalized(total), [0.0, 0.0, 1.0])


def _cap_middles(
    start: NDArray[np.float64], vertex: NDArray[np.int64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Middles [k, 3] of the smallest caps of the sphere that hold the normals at each vertex.

    The search begins at `start` [k, 3] (Badoiu and Clarkson 2003). `normals` [j, 3] are those of
    the triangles at the vertices [j].
    """
    middle = start.copy()
    for i in range(1, _NORMAL_STEPS):
        cosine = np.einsum("ij,ij->i", middle[vertex], normals)
        order = np.lexsort((cosine, vertex))
        farthest = order[np.searchsorted(vertex[order], np.arange(len(middle)))]
        middle += (normals[farthest] - middle) / (i + 1)
    return normalized(middle)


def _worst_cosines(
    normal: NDArray[np.float64], vertex: NDArray[np.int64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Least cosine between the normal of each vertex [k, 3] and the normals of its triangles.

    `normals` [j, 3] are those of the triangles at the vertices [j].
    """
    worst = np.full(len(normal), np.inf)
    np.minimum.at(worst, vertex, np.einsum("ij,ij->i", normal[vertex], normals))
    return worst


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """A manifold, oriented triangle mesh: closed or open, of any genus, in one part or several.

    Make one with `load_mesh` or `Mesh.from_arrays`, which mend what they are given. Every edge
    belongs to two triangles or, on a rim, to one; the triangles at a vertex form one fan; every
    triangle has an area. Where surfaces touch, each has vertices of its own at the same place.

    Attributes
    ----------
    V : float64 [vertex_count, 3]
        Vertices [m].
    F : int64 [triangle_count, 3]
        Triangles, counter-clockwise seen from outside, or, on an open part, from the side from
        which most were.
    uv : float64 [vertex_count, 2] or None
        The object's own texture coordinates, one pair a vertex (at a UV seam, one of the pairs that
        meet there).
    corner_uv : float64 [triangle_count, 3, 2] or None
        The object's own texture coordinates at every corner of every triangle: exact at seams.
    notes : tuple of str
        What was done to it on reading, one line each.
    name : str
        Its name in messages.
    looks : Looks or None
        The materials and colours of its triangles, if the file has any.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None
    corner_uv: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    name: str = "mesh"
    looks: Looks | None = None

    @classmethod
    def from_arrays(
        cls,
        V: ArrayLike,
        F: ArrayLike,
        uv: ArrayLike | None = None,
        name: str = "mesh",
        looks: Looks | None = None,
    ) -> Mesh:
        """Make a mesh of any triangle soup.

        Equal positions are merged, hairline cracks closed, and triangles that repeat or have no
        area dropped. Where more than two triangles meet along an edge, or fans of them at a vertex,
        the sheets are cut apart. A one-sided surface, such as a Moebius band, is cut open along a
        path. Then each part is wound alike: outwards if it is closed, as most of its triangles were
        if it is open. Nothing is filled. A mesh made from the arrays of another is the same mesh,
        without notes.

        Parameters
        ----------
        V : [vertex_count, 3]
            Vertices [m].
        F : [triangle_count, 3]
            Triangles in any winding.
        uv : [vertex_count, 2] or [triangle_count, 3, 2], optional
            Texture coordinates of the vertices as given (before merging), or of every corner.
        name : str
            Its name in messages.
        looks : Looks, optional
            Materials and colours of the triangles as given.

        Raises
        ------
        MeshError
            If there is no triangle with an area, or a vertex is not finite.
        """
        points, triangles, given_uv = _checked(V, F, uv, name)
        given_colors = None if looks is None else looks.colors
        data = _side_by_side(len(triangles), given_uv, given_colors)
        with np.errstate(under="ignore"):
            points, corners, notes = _cleaned(points, triangles, data, name)
        corner_uv = None
        vertex_uv = None
        if given_uv is not None:
            corner_uv = np.ascontiguousarray(corners.data[..., :2])
            vertex_uv = np.zeros((len(points), 2))
            vertex_uv[corners.F[::-1].ravel()] = corner_uv[::-1].reshape(-1, 2)
        if looks is not None:
            colors = None if given_colors is None else corners.data[..., -4:]
            looks = looks.of_triangles(corners.source, colors)
        return cls(points, corners.F, vertex_uv, corner_uv, notes, name, looks)

    @functools.cached_property
    def components(self) -> NDArray[np.int64]:
        """Part of each triangle, [triangle_count].

        Parts are numbered from 0, in the order of their first triangles.
        """
        return labels(sides_of(self.F)[0] // 3, len(self.F))

    @functools.cached_property
    def beside(self) -> NDArray[np.int64]:
        """The triangle beyond each side of every triangle, [triangle_count, 3]; -1 at rims."""
        return triangles_beside(self.F)

    @property
    def component_count(self) -> int:
        """Number of parts."""
        return int(self.components.max()) + 1

    @functools.cached_property
    def rims(self) -> tuple[NDArray[np.int64], ...]:
        """Boundary loops: vertices of each in order, the surface to their left seen from outside.

        Each begins at its lowest vertex; they are sorted by it.
        """
        alone = sides_of(self.F)[1]
        starts = self.F.ravel()[alone]
        ends = np.roll(self.F, -1, axis=1).ravel()[alone]
        following = dict(zip(starts.tolist(), ends.tolist(), strict=True))
        rims = []
        for start in sorted(following):
            rim = []
            while start in following:
                rim.append(start)
                start = following.pop(start)
            if rim:
                rims.append(np.array(rim, dtype=np.int64))
        return tuple(rims)

    @property
    def closed(self) -> bool:
        """Whether there is no rim."""
        return not self.rims

    @functools.cached_property
    def genus(self) -> NDArray[np.int64]:
        """Number of handles of every part, [component_count].

        An open part has the handles that it would have with lids on its holes.
        """
        part_count = self.component_count
        part_of_vertex = np.full(self.F.max() + 1, -1)
        part_of_vertex[self.F] = self.components[:, None]
        vertices = np.bincount(part_of_vertex[part_of_vertex >= 0], minlength=part_count)
        triangles = np.bincount(self.components)
        rim_edges = np.zeros(part_count, dtype=np.int64)
        rims = np.zeros(part_count, dtype=np.int64)
        for rim in self.rims:
            part = part_of_vertex[rim[0]]
            rim_edges[part] += len(rim)
            rims[part] += 1
        # every triangle has three sides; each inner edge has two of them, each edge of a rim one
        edges = (3 * triangles + rim_edges) // 2
        # Euler's formula is V - E + F = 2 - 2 genus - rims
        return (2 - (vertices - edges + triangles) - rims) // 2

    @functools.cached_property
    def triangle_areas(self) -> NDArray[np.float64]:
        """Triangle areas [m^2], shape [triangle_count]."""
        return triangle_areas(self.V, self.F)

    @property
    def area(self) -> float:
        """Surface area [m^2]."""
        return float(self.triangle_areas.sum())

    @property
    def volume(self) -> float:
        """Volume that the closed parts enclose [m^3]; open ones enclose none."""
        volume, _ = part_volumes(self.V, self.F, self.components)
        volume[self.components[sides_of(self.F)[1] // 3]] = 0
        return float(volume.sum())

    @functools.cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals, shape [vertex_count, 3]; see the function of this name."""
        return vertex_normals(self.V, self.F)


def _side_by_side(count: int, *data: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Data of the corners of triangles, [count, 3, k each], as one array; None is left out."""
    columns = [np.empty((count, 3, 0))]
    columns += [values for values in data if values is not None]
    return np.concatenate(columns, axis=2)


def _checked(
    V: ArrayLike, F: ArrayLike, uv: ArrayLike | None, name: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64] | None]:
    try:
        points = np.asarray(V, dtype=np.float64)
        triangles = np.asarray(F)
        if triangles.dtype.kind not in "iu":
            raise TypeError(f"F must hold integers, got {triangles.dtype}")
        triangles = triangles.astype(np.int64)
    except (TypeError, ValueError) as error:
        raise MeshError(f"{name}: V and F must be arrays of numbers: {error}") from error
    if (
        points.ndim != 2
        or points.shape[1] != 3
        or triangles.ndim != 2
        or triangles.shape[1] != 3
        or not len(triangles)
    ):
        raise MeshError(
            f"{name}: V must be [n, 3] and F [m, 3] with m > 0, got {points.shape} and "
            f"{triangles.shape}"
        )
    low = triangles.min()
    high = triangles.max()
    if low < 0 or high >= len(points):
        raise MeshError(
            f"{name}: triangle indices must be 0 to {len(points) - 1}, got {low} to {high}"
        )
    used = distinct(triangles)
    bad = used[~np.isfinite(points[used]).all(axis=1)]
    if len(bad):
        raise MeshError(
            f"{name}: {len(bad)} vertices are NaN or infinite (the first is vertex {bad[0]})"
        )
    with np.errstate(over="ignore"):
        extent = np.ptp(points[used], axis=0).max()
    if not _MIN_SIZE <= extent <= _MAX_SIZE:
        raise MeshError(
            f"{name}: its size must be {_MIN_SIZE:g} to {_MAX_SIZE:g} m, got {extent:.3g} m"
        )
    if uv is None:
        return points, triangles, None
    pairs = np.asarray(uv, dtype=np.float64)
    valid = (len(points), 2), (*triangles.shape, 2)
    if pairs.shape not in valid:
        raise MeshError(f"{name}: uv must have shape {valid[0]} or {valid[1]}, got {pairs.shape}")
    return points, triangles, pairs[triangles] if pairs.ndim == 2 else pairs


def _cleaned(
    V: NDArray[np.float64], F: NDArray[np.int64], data: NDArray[np.float64], name: str
) -> tuple[NDArray[np.float64], Corners, tuple[str, ...]]:
    """Make a triangle soup a manifold, oriented surface of triangles that have an area.

    Returns vertices, corners and notes of what was done, one line each. A surface that needs
    nothing stays unchanged.
    """
    unused = len(V) - len(distinct(F))
    notes = [f"{counted(unused, 'unreferenced vertex')} dropped"] if unused else []
    merged, joined = merged_vertices(V, F)
    empty = collapsed(merged)
    keep = distinct_triangles(merged)
    all_corners = Corners(F=merged, user_vertex=F, data=data, source=np.arange(len(F)))
    corners, slivers = without_slivers(V, all_corners.subset(keep))
    if len(corners.F) == 0:
        raise MeshError(
            f"{name} has no triangle with an area: none has three different corners that lie on no "
            f"line"
        )
    used_vertices = distinct(corners.F)
    corners = dataclasses.replace(corners, F=np.searchsorted(used_vertices, corners.F))
    points, corners, cuts = cut_apart(V[used_vertices], corners, used_vertices)
    merges, splits = _merges_and_splits(corners)
    turned, turns = oriented(points, corners)
    repeated = ~keep & ~empty
    if merges > joined:
        notes.append(f"{counted(merges - joined, 'duplicate vertex')} merged")
    if joined:
        notes.append(f"cracks closed: {counted(joined, 'boundary vertex')} joined")
    if empty.any():
        notes.append(f"{counted(int(empty.sum()), 'triangle')} with a repeated vertex dropped")
    if repeated.any():
        notes.append(f"{counted(int(repeated.sum()), 'repeated triangle')} dropped")
    if slivers:
        notes.append(f"{counted(slivers, 'triangle')} without area dropped")
    # a surface that was cut before is merged at equal positions and cut again in the same way:
    # nobody needs to know
    if merges or splits:
        notes += cuts
    return points, turned, (*notes, *turns)


def _merges_and_splits(corners: Corners) -> tuple[int, int]:
    """How many vertices went by merging with others, and how many were added by cutting."""
    vertex_count = corners.F.max() + 1
    from_user = corners.user_vertex.ravel() >= 0
    user_vertex = corners.user_vertex.ravel()[from_user]
    # pairs of a vertex in the user's arrays and a vertex of the result
    pairs = distinct(user_vertex * vertex_count + corners.F.ravel()[from_user])
    results = len(distinct(pairs % vertex_count))
    merges = len(pairs) - results
    splits = len(pairs) - len(distinct(user_vertex)) + int(vertex_count) - results
    return merges, splits


def many_parts(mesh: Mesh) -> str:
    """Advice for a mesh of very many parts; "" for other meshes."""
    parts = mesh.component_count
    if parts <= _MANY_PARTS:
        return ""
    return f"wrap (--wrap) would put one closed surface round its {parts:,} parts"


def check_genus_zero(mesh: Mesh) -> None:
    """Raise `MeshError` unless the mesh is a closed surface of genus 0 in one part.

    The message names every defect.
    """
    defects = []
    advice = ""
    parts = mesh.component_count
    if parts > 1:
        defects.append(
            f"in {parts:,} separate parts (it must be in one; keep the part you want, or join them)"
        )
    if not mesh.closed:
        edges = sum(len(rim) for rim in mesh.rims)
        near = place(mesh.V[mesh.rims[0][:2]].mean(axis=0))
        defects.append(
            f"open: {counted(edges, 'boundary edge')} round {counted(len(mesh.rims), 'hole')} (one "
            f"near {near})"
        )
        advice = "; repair (--repair) closes holes"
    handles = int(mesh.genus.sum())
    if parts == 1 and handles:
        defects.append(f"of genus {handles} (it must be of genus 0, without handles or tunnels)")
    if many_parts(mesh):
        advice = f"; {many_parts(mesh)}"
    if defects:
        cuts = "".join(f"; {note}" for note in mesh.notes if note.startswith("cut "))
        raise MeshError(
            f"{mesh.name} is not a closed genus-0 surface: it is "
            f"{', and '.join(defects)}{cuts}{advice}"
        )
    extent = np.ptp(mesh.V, axis=0).max()
    if not abs(mesh.volume) > _MIN_ENCLOSED_VOLUME * extent**3:
        raise MeshError(
            f"{mesh.name} is degenerate: it encloses no volume ({mesh.volume:.3g} m^3 at a size of "
            f"{extent:.3g} m)"
        )
