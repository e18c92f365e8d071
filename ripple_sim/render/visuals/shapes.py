"""Shapes of visuals: the mesh with which each kind of geom is drawn, and its sizes.

Every MuJoCo primitive is the Minkowski sum of a box-like core and a ball-like shell. A point of it
is `core * core_size + shell * shell_size`, component by component. A sphere has no core; the core
of a capsule is a segment, the core of a box is a box. Boxes and cylinders get a small round shell:
edges that catch the light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.target_mesh import height_field_triangles, mesh_arrays
from ripple_sim.render.pose import Pose
from ripple_sim.solver.layouts.cube.convention import CHART_NORMALS, CHART_U, CHART_V

from .corners import normalized, split_corners
from .visual import WALLS, Visual

_BEVEL = 0.06  # radius of round edges, in smallest half sizes
_INFINITE_HALF_SIZE = 100.0  # of infinite planes, in extents of the model
_MIN_LINE_WIDTH = 1e-3  # keeps normals finite [pixels]
_GEOM = mujoco.mjtGeom


@dataclass(frozen=True)
class Shape:
    """A triangle mesh whose vertices scale with two sizes.

    `core`, `shell` and `normals` have shape [n, 3], `faces` shape [m, 3]; `uv`, shape [n, 2], are
    texture coordinates where the mesh has any.
    """

    core: NDArray[np.float64]
    shell: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None

    def positions(
        self, core_size: NDArray[np.float64], shell_size: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Vertices [n, 3] for the two sizes [m], shape [3] each."""
        return self.core * core_size + self.shell * shell_size


def ball(divisions: int) -> Shape:
    """Unit sphere: a cube of `divisions` squares an edge, projected at equal angles.

    Also for ellipsoids.
    """
    points, faces = _cube_grid(np.linspace(-1.0, 1.0, divisions + 1))
    directions = normalized(np.tan(np.pi / 4 * points))
    return Shape(np.zeros_like(directions), directions, directions, faces)


def box(divisions: int) -> Shape:
    """Box with half sizes core + shell and round edges of `divisions` segments."""
    # a face's grid line is straight between -1 and 1 and bends round the edges beyond; an edge's
    # middle is at 1.5
    bend = np.linspace(0.0, 0.5, divisions + 1)[1:]
    points, faces = _cube_grid(np.concatenate([-1 - bend[::-1], [-1.0, 1.0], 1 + bend]))
    core = np.clip(points, -1.0, 1.0)
    directions = normalized(np.tan(np.pi / 2 * (points - core)))
    return Shape(core, directions, directions, faces)


def capsule(sides: int, rings: int) -> Shape:
    """Capsule along z: the core is a segment of half length core_size[2], the shell a ball."""
    angle = np.concatenate(
        [np.linspace(-np.pi / 2, 0, rings + 1), np.linspace(0, np.pi / 2, rings + 1)]
    )
    core_z = np.repeat([-1.0, 1.0], rings + 1)
    return _revolved(np.zeros_like(angle), core_z, np.cos(angle), np.sin(angle), sides)


def cylinder(sides: int, rings: int) -> Shape:
    """Cylinder along z with round rims: radius and half height are core + shell."""
    lower = np.linspace(-np.pi / 2, 0, rings + 1)
    upper = np.linspace(0, np.pi / 2, rings + 1)
    angle = np.concatenate([[-np.pi / 2], lower, upper, [np.pi / 2]])
    core_r = np.concatenate([[0.0], np.ones(2 * rings + 2), [0.0]])
    core_z = np.repeat([-1.0, 1.0], rings + 2)
    return _revolved(core_r, core_z, np.cos(angle), np.sin(angle), sides)


def sheet() -> Shape:
    """Square of half size 1, visible from above only."""
    core = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Shape(core, up, up, np.array([[0, 1, 2], [0, 2, 3]]))


def triangle() -> Shape:
    """Right triangle in the xy plane, whose legs of length 1 meet at the origin."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return Shape(corners, np.zeros((3, 3)), np.tile([0.0, 0.0, 1.0], (3, 1)), np.array([[0, 1, 2]]))


def line() -> Shape:
    """Ribbon along z from 0 to 1 in the xz plane.

    The core has half its width at the start, the shell half its width at the end.
    """
    core = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    shell = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    across = np.tile([0.0, 1.0, 0.0], (4, 1))
    return Shape(core, shell, across, np.array([[0, 1, 2], [0, 2, 3]]))


def _cube_grid(line: NDArray) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and outward triangles of a cube with the grid `line` x `line` on each face.

    Vertices on the cube's edges are shared. They are found by whole numbers: a coordinate is the
    entry of `line` at (lattice + last) / 2.
    """
    last = len(line) - 1
    row, column = np.divmod(np.arange(len(line) ** 2), len(line))
    a = 2 * column - last
    b = 2 * row - last
    lattice = (
        last * CHART_NORMALS[:, None]
        + a[:, None] * CHART_U[:, None]
        + b[:, None] * CHART_V[:, None]
    )
    corner = (np.arange(last)[:, None] * len(line) + np.arange(last)).ravel()
    quad = np.stack([corner, corner + 1, corner + len(line) + 1, corner + len(line)], axis=1)
    quads = np.concatenate([quad + face * len(line) ** 2 for face in range(6)])
    welded, index = np.unique(lattice.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return line[(welded + last) // 2], index.ravel()[triangles]


def _revolved(
    core_r: NDArray, core_z: NDArray, shell_r: NDArray, shell_z: NDArray, sides: int
) -> Shape:
    """Revolve a profile about z, from the lower pole to the upper one.

    The poles are single vertices.
    """
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(sides)], axis=1)
    axis = np.array([0.0, 0.0, 1.0])

    def rings(radius: NDArray, height: NDArray) -> NDArray[np.float64]:
        body = radius[1:-1, None, None] * circle + height[1:-1, None, None] * axis
        return np.concatenate([[height[0] * axis], body.reshape(-1, 3), [height[-1] * axis]])

    count = len(core_r) - 2
    index = 1 + np.arange(count * sides).reshape(count, sides)
    after = np.roll(index, -1, axis=1)
    bottom = np.stack([np.zeros(sides, dtype=np.int64), after[0], index[0]], axis=1)
    a = index[:-1]
    b = after[:-1]
    c = after[1:]
    d = index[1:]
    between = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=1)
    top = np.stack([index[-1], after[-1], np.full(sides, 1 + count * sides)], axis=1)
    core = rings(core_r, core_z)
    shell = normalized(rings(shell_r, shell_z))
    return Shape(core, shell, shell, np.concatenate([bottom, between.reshape(-1, 3), top]))


def _arrow(*profile: tuple[float, float]) -> Callable[[int], Shape]:
    """Solid of revolution about z, of radii and heights from the lower pole to the upper one."""

    def make(segments: int) -> Shape:
        radius, height = np.array(profile).T
        flat = _revolved(radius, height, np.zeros_like(radius), height, 4 * segments)
        return creased(flat.core, flat.faces)

    return make


def mesh_asset(model: Any, mesh: int, hull: bool = False) -> Shape:
    """Mesh of a MuJoCo model in its geom's frame, or its convex hull."""
    V, F, uv = mesh_arrays(model, mesh)
    if hull and model.mesh_graphadr[mesh] >= 0:
        graph = model.mesh_graph[model.mesh_graphadr[mesh] :]
        vertices = int(graph[0])
        triangles = int(graph[1])
        end = 2 + 3 * vertices + 6 * triangles
        return creased(V, graph[end - 3 * triangles : end].reshape(-1, 3).astype(np.int64))
    return creased(V, F, uv)


def height_field(model: Any, hfield: int, walls_only: bool = False) -> Shape:
    """Height field of a MuJoCo model with its walls, or the walls alone, in its geom's frame."""
    ground, F = height_field_triangles(model, hfield)
    index = np.arange(len(ground)).reshape(model.hfield_nrow[hfield], model.hfield_ncol[hfield])
    # round the rim, counter-clockwise from above
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    foot = len(ground) + np.arange(len(rim))
    after = np.roll(rim, -1)
    foot_after = np.roll(foot, -1)
    walls = np.stack([rim, foot, foot_after], axis=1), np.stack([rim, foot_after, after], axis=1)
    feet = ground[rim] * [1, 1, 0] - [0, 0, model.hfield_size[hfield, 3]]
    V = np.concatenate([ground, feet])
    F = np.concatenate(walls if walls_only else [F, *walls])
    return creased(V, F)


def creased(V: NDArray, F: NDArray, corner_uv: NDArray | None = None) -> Shape:
    """Shape of a mesh, with vertices split where normals or texture coordinates [m, 3, 2] jump."""
    vertices, faces, normals, uv, _ = split_corners(V, F, corner_uv)
    positions = V[vertices]
    no_core = np.zeros_like(positions)
    return Shape(no_core, positions, normals, faces, None if corner_uv is None else uv)


# Name of a shape, and a function that makes the shape with a number of segments to a right angle.
NamedShape: TypeAlias = tuple[str, Callable[[int], Shape]]
_SHAPES: dict[int, NamedShape] = {
    _GEOM.mjGEOM_SPHERE: ("ball", ball),
    _GEOM.mjGEOM_ELLIPSOID: ("ball", ball),
    _GEOM.mjGEOM_CAPSULE: ("capsule", lambda n: capsule(4 * n, n)),
    _GEOM.mjGEOM_CYLINDER: ("cylinder", lambda n: cylinder(4 * n, 3)),
    _GEOM.mjGEOM_BOX: ("box", lambda n: box(min(n // 3, 3))),
    _GEOM.mjGEOM_PLANE: ("sheet", lambda n: sheet()),
    _GEOM.mjGEOM_TRIANGLE: ("triangle", lambda n: triangle()),
    _GEOM.mjGEOM_LINE: ("line", lambda n: line()),
    # MuJoCo's arrows: a shaft of radius 1 and length 2, and a head of length 1
    _GEOM.mjGEOM_ARROW: ("arrow", _arrow((0, 0), (1, 0), (1, 2), (1.75, 2), (0, 3))),
    _GEOM.mjGEOM_ARROW1: ("arrow1", _arrow((0, 0), (1, 0), (1, 2), (0, 3))),
    _GEOM.mjGEOM_ARROW2: (
        "arrow2",
        _arrow((0, -3), (1.75, -2), (1, -2), (1, 2), (1.75, 2), (0, 3)),
    ),
}


def shape_of(model: Any, visual: Visual) -> NamedShape | None:
    """Name of the shape of a visual, and a function that makes it; None without a shape.

    The function takes the number of segments to a right angle.
    """
    kind = visual.kind
    asset = visual.asset
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and asset >= 0:
        name = f"{'hull' if visual.hull else 'mesh'} {asset}"
        return name, lambda _: mesh_asset(model, asset, visual.hull)
    if visual.corners is not None:
        own = visual.corners.astype(np.float64)
        points = own[:, :3]
        normals = own[:, 3:6]
        uv = own[:, 6:]
        faces = np.arange(len(own)).reshape(-1, 3)
        name = f"{kind} {visual.part} {visual.identity[0]}"
        return name, lambda _: Shape(np.zeros_like(points), points, normals, faces, uv)
    if kind == _GEOM.mjGEOM_HFIELD and asset >= 0 and visual.part == WALLS:
        return f"{WALLS} {asset}", lambda _: height_field(model, asset, walls_only=True)
    if kind == _GEOM.mjGEOM_HFIELD and asset >= 0:
        return f"hfield {asset}", lambda _: height_field(model, asset)
    return _SHAPES.get(kind)


def sizes(
    model: Any, visual: Visual, bevel: float = _BEVEL
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Core and shell size of a visual [m], shape [3] each; see the top of the module.

    `bevel` is the radius of round edges over the smallest half size. The width of a line is
    in pixels, see `facing_lines`.
    """
    half = visual.half_sizes
    match visual.kind:
        case _GEOM.mjGEOM_SPHERE | _GEOM.mjGEOM_ELLIPSOID:
            return np.zeros(3), half
        case _GEOM.mjGEOM_CAPSULE:
            return np.array([0.0, 0.0, half[2]]), np.full(3, half[0])
        case _GEOM.mjGEOM_PLANE:
            half = np.where(half > 0, half, _INFINITE_HALF_SIZE * model.stat.extent)
            return np.array([half[0], half[1], 0.0]), np.full(3, 1e-9)
        case _GEOM.mjGEOM_TRIANGLE:
            return half * [1, 1, 0], np.full(3, 1e-9)
        case _GEOM.mjGEOM_LINE:
            width = max(half[0] * model.vis.global_.linewidth, _MIN_LINE_WIDTH)
            size = np.array([width / 2, width / 2, half[2]])
            return size, size
        case _GEOM.mjGEOM_CYLINDER | _GEOM.mjGEOM_BOX:
            round_edge = bevel * half.min()
            return half - round_edge, np.full(3, round_edge)
        case _GEOM.mjGEOM_ARROW | _GEOM.mjGEOM_ARROW1 | _GEOM.mjGEOM_ARROW2:
            return np.zeros(3), half / [1, 1, 6]
        case _:
            return np.zeros(3), np.ones(3)


def facing_lines(
    pixel_sizes: NDArray[np.float64],
    starts: NDArray[np.float64],
    rotations: NDArray[np.float64],
    pose: Pose,
    height: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lay the ribbons of lines across the view, and make them equally wide along their lengths.

    A ribbon has the line's depth across all of its width.

    Parameters
    ----------
    pixel_sizes : float64 [k, 2, 3]
        Core and shell sizes, with widths in pixels, see `sizes`.
    starts, rotations : array, shapes [k, 3] and [k, 3, 3]
        Where the lines begin [m], and rotations of their frames; lines extend along z.
    pose, height
        The camera, and the height of its frame [pixels].

    Returns
    -------
    frames : float64 [k, 3, 3]
        Axes of the ribbons, as columns.
    sizes : float64 [k, 2, 3]
        Core and shell sizes [m].
    """
    axes = rotations[:, :, 2]
    ends = starts + axes * pixel_sizes[:, 0, 2:]
    forward = -pose.rotation[:, 2]
    ways = pose.ways(starts)
    # directions of the lines in the picture, in the plane of the picture
    seen = axes * (ways @ forward)[:, None] - ways * (axes @ forward)[:, None]
    across = np.cross(forward, seen)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    # a line that is seen along its axis is a point
    across = np.where(length > 0, across / np.maximum(length, 1e-300), rotations[:, :, 0])
    frames = np.stack([across, np.cross(axes, across), axes], axis=2)
    _, depth = pose.local(np.stack([starts, ends], axis=1))
    near, _ = pose.clip_planes
    distance = np.ones_like(depth) if pose.orthographic else np.maximum(depth, near)
    scaled = pixel_sizes.copy()
    scaled[:, :, :2] *= (distance * pose.pixel_height(1.0, height))[..., None]
    return frames, scaled
