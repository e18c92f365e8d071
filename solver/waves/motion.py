"""An atlas whose vertices move: its operator, and the gradients of the height on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, shown, warn_caller
from ..kernel import Floats, Floats32, Ints, kernel
from ..mesh.moved_mesh import MovedMesh
from ..mesh.topology import Folds, edges_of
from ..operator.material import Material
from ..operator.moving_operator import MovingOperator
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from ..texels.moving import MovedPlaces, SurfaceRide
from ..texels.texel_mesh import TexelMesh, tangents
from .height_map import fill_around

# The stiffness is computed again once the square of an edge's length has changed by this share
# since the last time.
_SQUARED_LENGTH_TOLERANCE = 2e-3

# Folds are counted once in this many computations of the stiffness: both take about as long.
_FOLD_CHECK_INTERVAL = 8

# Least area of a texel's moved parallelogram, as a share of the product of its squared sides:
# beside a flat one gradients stay finite.
_MIN_SQUARED_SINE = 1e-6


class Motion:
    """Moves the texels of an atlas with its vertices.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    operator : WaveOperator
        At rest.

    Attributes
    ----------
    rest : Atlas
    V : float64 [n, 3]
        The vertices now [m].
    """

    def __init__(self, atlas: Atlas, material: Material, operator: WaveOperator) -> None:
        self.rest = atlas
        self.V = atlas.mesh.V
        self._ride = SurfaceRide(atlas)
        self._operator = MovingOperator(atlas, material, operator)
        self._folds = Folds(atlas.mesh.V, np.asarray(atlas.mesh.F, np.int64))
        self._edges = edges_of(self._folds.F).ends
        self._squares, _ = _square_lengths(self.V, self._edges, np.zeros(len(self._edges)))
        self._now = operator
        # the atlas and the areas where the vertices are now; None until somebody asks for them
        self._atlas: Atlas | None = None
        self._areas: NDArray[np.float64] | None = None
        self._warned = False
        self._looks = 0

    def to(self, vertices: ArrayLike) -> WaveOperator | None:
        """Move the vertices [n, 3] [m]; return the operator there.

        Returns None where all lengths are as they were. Raises `SolverError` if the vertices are
        not finite, or have another shape than the vertices of the mesh.
        """
        self.V = self._checked(vertices)
        self._atlas = None
        squares, changed = _square_lengths(self.V, self._edges, self._squares)
        if not changed:
            return None
        self._squares = squares  # another array: copies have the one before
        self._now = self._operator.at(MovedPlaces(self._ride, self.V))
        self._areas = None
        self._looks += 1
        if self._warned or self._looks % _FOLD_CHECK_INTERVAL != 1:
            return self._now
        count = self._folds.count(self.V)
        if count:
            self._warned = True
            warn_caller(
                f"{count} of {len(self._folds.F)} triangles of the moving surface are turned over "
                "or without area; waves there are wrong: move the vertices less, or use a stiffer "
                "body"
            )
        return self._now

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of each texel [m^2], [C, n, n]."""
        if self._areas is None:
            self._areas = self._operator.areas(self._now.stencil)
        return self._areas

    @property
    def atlas(self) -> Atlas:
        """The atlas where the vertices are."""
        if self._atlas is None:
            self._atlas = self._moved_atlas()
        return self._atlas

    def _moved_atlas(self) -> Atlas:
        rest = self.rest
        vertex_normals = self._folds.vertex_normals(self.V)
        positions, beyond = self._ride.positions(self.V)
        texels = TexelMesh(
            topology=rest.texels.topology,
            positions=positions,
            normals=self._ride.normals(vertex_normals),
            areas=self.areas,
            beyond=beyond,
            detours=rest.texels.detours,
        )
        mesh = MovedMesh.of(rest.mesh, self.V, vertex_normals)
        return Atlas(mesh, texels, rest.chart_map, rest.triangles, rest.barycentrics)

    def _checked(self, vertices: ArrayLike) -> NDArray[np.float64]:
        shape = self.rest.mesh.V.shape
        try:
            V = np.array(vertices, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SolverError(
                f"vertices must be numbers of shape {shape}, in m, got {shown(vertices)}"
            ) from error
        if V.shape != shape:
            raise SolverError(
                f"vertices have shape {V.shape}; the mesh of this surface has {shape}: give all of "
                "its vertices, in the order of `atlas.mesh.V`"
            )
        if not np.isfinite(V).all():
            raise SolverError(
                f"vertices must be finite [m], got {(~np.isfinite(V)).sum()} numbers that are not"
            )
        return V


@kernel
def _square_lengths(V: Floats, edges: Ints, before: Floats) -> tuple[Floats, bool]:
    """Squared lengths [k] of edges [k, 2], and whether any differs from `before` [k].

    In NumPy this would take as long as the rest of a motion.
    """
    squares = np.empty(len(edges))
    changed = False
    for i in range(len(edges)):
        a = edges[i, 0]
        b = edges[i, 1]
        total = 0.0
        for k in range(3):
            total += (V[b, k] - V[a, k]) ** 2
        squares[i] = total
        if not abs(total - before[i]) <= _SQUARED_LENGTH_TOLERANCE * before[i]:
            changed = True
    return squares, changed


class MovedGradients:
    """Turns a height map of the surface at rest into a height map of the moved surface.

    Heights stay with the texels. So their differences along rows and columns stay, while the
    distances change.
    """

    def __init__(self, rest: Atlas) -> None:
        self._texels = rest.texels
        self._ride = SurfaceRide(rest)
        self._rest = np.stack(tangents(rest.texels.halo_positions), axis=3)

    def __call__(
        self, height_map: NDArray[np.float32], V: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Height map [C, n + 2, n + 2, 4], see `HeightMap`, where the vertices are at V [m].

        V is [vertex_count, 3].
        """
        halo_positions = np.moveaxis(self._ride.around(V), 0, -1)
        moved_tangents = np.stack(tangents(halo_positions), axis=3)
        moved = np.array(height_map, np.float32)
        _carry(self._rest, moved_tangents, moved)
        fill_around(self._texels.topology, moved)
        return moved


@kernel
def _carry(rest: Floats, moved: Floats, height_map: Floats32) -> None:
    """Replace gradients at rest by gradients with the same differences along moved tangents.

    The tangents are those of rows and of columns, [C, n, n, 2, 3].
    """
    charts, n = rest.shape[:2]
    for chart in range(charts):
        for r in range(n):
            for c in range(n):
                g = height_map[chart, r + 1, c + 1]
                t = rest[chart, r, c]
                m = moved[chart, r, c]
                a = t[0, 0] * g[0] + t[0, 1] * g[1] + t[0, 2] * g[2]
                b = t[1, 0] * g[0] + t[1, 1] * g[1] + t[1, 2] * g[2]
                uu = m[0, 0] ** 2 + m[0, 1] ** 2 + m[0, 2] ** 2
                vv = m[1, 0] ** 2 + m[1, 1] ** 2 + m[1, 2] ** 2
                uv = m[0, 0] * m[1, 0] + m[0, 1] * m[1, 1] + m[0, 2] * m[1, 2]
                area = max(uu * vv - uv * uv, _MIN_SQUARED_SINE * uu * vv)
                along = vv * a - uv * b
                across = uu * b - uv * a
                for k in range(3):
                    g[k] = (along * m[0, k] + across * m[1, k]) / area if area > 0 else 0.0
