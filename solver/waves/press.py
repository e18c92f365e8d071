"""The imprint of what presses on a surface at rest: displacement, pressure and forces.

MuJoCo's `tactile` sensor tells how deep a body is in a pad, as if the pad gave way at each taxel by
itself. A skin that is held at its rim gives way as a whole: its tension spreads each force. The
forces that press the skin as deep as the sensor says are nowhere negative, and 0 where the skin is
pressed deeper by its neighbours: the obstacle problem for a membrane, a linear complementarity
problem (Cottle, Pang and Stone 1992, The Linear Complementarity Problem).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh
from scipy.optimize import nnls
from scipy.sparse import csc_array

from ..errors import SolverError
from ..kernel import Bools, Floats
from ..mesh.points import check_points
from ..operator.statics import StaticSurface
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from .finite import require_finite
from .footprint import weigh_each

# Eigenvalues of the compliance below this share of the greatest one are round-off: two points on
# one texel press on the same place.
_MIN_EIGENVALUE_SHARE = 1e-10

# Columns of the compliance that are solved for together: more take memory, fewer take calls.
_COLUMNS_TOGETHER = 64


class Imprint(NamedTuple):
    """What presses on a surface at rest, and how the surface lies.

    Attributes
    ----------
    height : float64 [C, n, n]
        Displacement [m], positive outwards.
    pressure : float64 [C, n, n]
        [Pa], positive inwards. Its sum over the areas is the sum of the forces.
    forces : float64 [k]
        Force at each point [N], positive inwards.
    """

    height: Floats
    pressure: Floats
    forces: Floats


class Stamp:
    """Points where something presses on a surface at rest, each with a footprint.

    Parameters
    ----------
    atlas : Atlas
    surface : StaticSurface
    points : [k, 3]
        [m]; the nearest points of the surface are taken.
    radius : float
        Radius of each footprint [m], along the surface; at least two texels are used.

    Raises
    ------
    SolverError
        If the radius is negative or not finite.
    AtlasError
        If the points are not finite.
    """

    def __init__(
        self, atlas: Atlas, surface: StaticSurface, points: ArrayLike, radius: float
    ) -> None:
        require_finite("radius", radius, "m", least=0.0)
        closest, centers = atlas.nearest(check_points(points))
        radii = np.full(len(centers), float(radius))
        begins, texels, weights, _ = weigh_each(atlas.texels.grid, centers, closest, radii)
        self._areas = atlas.areas
        self._surface = surface
        areas = atlas.areas.reshape(-1)
        # column i spreads a force of 1 N at point i over the texels
        self._shares = csc_array(
            (weights * areas[texels], texels, begins), shape=(areas.size, len(centers))
        )
        self._compliance: Floats | None = None

    def press(self, forces: ArrayLike) -> Imprint:
        """The imprint of forces [N], [k] or one for all points, positive inwards."""
        count = self._shares.shape[1]
        forces = _one_for_each_point("forces", forces, count)
        loads = self._shares @ forces
        height = self._surface.heights(loads).reshape(self._areas.shape)
        pressure = loads.reshape(self._areas.shape) / self._areas
        return Imprint(height, pressure, forces)

    def press_to(self, depths: ArrayLike) -> Imprint:
        """The imprint of something that reaches down to given depths [m], [k] or one for all.

        A point whose depth is not above 0 is not touched. The surface is at least as deep as every
        touched point, by the mean over the point's footprint, and exactly so deep where it is
        pressed.
        """
        count = self._shares.shape[1]
        depths = _one_for_each_point("depths", depths, count)
        in_contact = np.flatnonzero(depths > 0)
        forces = np.zeros(count)
        if len(in_contact):
            compliance = self.compliance[np.ix_(in_contact, in_contact)]
            forces[in_contact] = _contact_forces(compliance, depths[in_contact])
        return self.press(forces)

    @property
    def compliance(self) -> Floats:
        """Depth at each point under 1 N at each other point [m/N], [k, k]; computed once."""
        if self._compliance is None:
            count = self._shares.shape[1]
            compliance = np.empty((count, count))
            for first in range(0, count, _COLUMNS_TOGETHER):
                columns = slice(first, first + _COLUMNS_TOGETHER)
                heights = self._surface.heights(self._shares[:, columns].toarray())
                compliance[:, columns] = -(self._shares.T @ heights)
            self._compliance = (compliance + compliance.T) / 2  # but for round-off it is symmetric
        return self._compliance


class Stamps:
    """The latest stamp on the surface of a solver: its factor and compliance are used again."""

    def __init__(self) -> None:
        self._surface: StaticSurface | None = None
        self._surface_key: tuple[object, ...] = ()
        self._stamp: Stamp | None = None
        self._stamp_key: tuple[object, ...] = ()

    def stamp(
        self,
        atlas: Atlas,
        operator: WaveOperator,
        kept_parts: Bools,
        points: ArrayLike,
        radius: float,
    ) -> Stamp:
        """The stamp of these points, made anew where surface, points or radius differ."""
        surface_key = (operator, kept_parts.tobytes())
        if self._surface is None or surface_key != self._surface_key:
            self._surface = StaticSurface(operator, kept_parts)
            self._surface_key = surface_key
            self._stamp = None
        checked = check_points(points)
        stamp_key = (checked.tobytes(), radius)
        if self._stamp is None or stamp_key != self._stamp_key:
            self._stamp = Stamp(atlas, self._surface, checked, radius)
            self._stamp_key = stamp_key
        return self._stamp


def _contact_forces(compliance: Floats, depths: Floats) -> Floats:
    """Forces p >= 0 with G p >= d, and p = 0 where G p > d.

    They minimise p' G p / 2 - d' p, which is the least-squares problem of nonnegative p for any
    root of G.
    """
    eigenvalues, vectors = eigh(compliance)
    is_real = eigenvalues > _MIN_EIGENVALUE_SHARE * eigenvalues[-1]
    root = np.sqrt(eigenvalues[is_real])
    modes = vectors[:, is_real].T
    forces, _ = nnls(root[:, None] * modes, (modes @ depths) / root)
    return forces


def _one_for_each_point(name: str, values: ArrayLike, count: int) -> Floats:
    """Finite numbers, one for each point."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (count,)) or not np.isfinite(array).all():
        raise SolverError(
            f"{name} must be finite: one number, or one for each of {count} points; got shape "
            f"{array.shape}"
        )
    return np.array(np.broadcast_to(array, (count,)))
