"""Assertions for tests of your own: where impulses arrive, where waves are, and their symmetry.

They raise `AssertionError` with the numbers that were found, and so work in pytest, in unittest and
in a plain script.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.coupling.target_waves import TargetWaves
from ripple_sim.errors import SceneError
from ripple_sim.solver import RippleError, WaveSolver
from ripple_sim.solver.errors import POSITIVE, checked, instance
from ripple_sim.solver.mesh.points import check_points

__all__ = [
    "assert_impulse_at",
    "assert_symmetric",
    "assert_wave_at",
    "asymmetry",
    "record_impulses",
]

# Turns about an axis that are compared with no turn: their angles are no symmetries of a grid.
_TURNS = 7

# How far the image of a texel under a symmetry may lie off the surface, in mean texel widths. An
# image that is farther off shows that the surface itself does not have the symmetry.
_MAX_OFF_SURFACE = 1.0


@checked(
    SceneError,
    ripples=instance(Ripples, ", for instance Ripples(model, materials)"),
    duration=POSITIVE,
)
def record_impulses(ripples: Ripples, data: mujoco.MjData, duration: float) -> list[Impulse]:
    """Take physics steps for a time, and return all impulses that targets got.

    Parameters
    ----------
    ripples : Ripples
    data : mujoco.MjData
        Of the model of the ripples; it is advanced.
    duration : float
        [s]; rounded to whole steps.

    Raises
    ------
    SceneError
        If `data` belongs to another model, or the duration is not a positive number.
    """
    impulses: list[Impulse] = []
    for _ in range(max(1, round(duration / ripples.model.opt.timestep))):
        ripples.mj_step(data)
        impulses += ripples.last_impulses
    return impulses


@checked(RippleError, within=POSITIVE, rtol=POSITIVE)
def assert_impulse_at(
    impulses: Ripples | Sequence[Impulse],
    point: ArrayLike,
    *,
    within: float,
    impulse: float | None = None,
    rtol: float = 0.05,
    geom: str | None = None,
    other: str | None = None,
) -> list[Impulse]:
    """Assert that a target was hit at a point, and how hard.

    Parameters
    ----------
    impulses : Ripples or sequence of Impulse
        From `record_impulses`, or a list of your own. Of `Ripples` those of the latest step.
    point : [3]
        In the world [m].
    within : float
        Greatest distance of an impulse from the point [m].
    impulse : float, optional
        Sum of the impulses within that distance [N s], positive inwards.
    rtol : float
        Relative tolerance of the sum.
    geom, other : str, optional
        Only impulses that this target got, or that this geom gave.

    Returns
    -------
    list of Impulse
        Those within that distance.

    Raises
    ------
    AssertionError
        If none is there, or their sum is another one.
    RippleError
        If an argument is invalid.
    """
    (place,) = check_points(point)
    hits = impulses.last_impulses if isinstance(impulses, Ripples) else list(impulses)
    if geom is not None:
        hits = [hit for hit in hits if hit.geom == geom]
    if other is not None:
        hits = [hit for hit in hits if hit.other == other]
    if not hits:
        raise AssertionError(f"there was no impulse{_between(geom, other)}")
    distances = np.array([np.linalg.norm(hit.point - place) for hit in hits])
    near = [hit for hit, distance in zip(hits, distances, strict=True) if distance <= within]
    if not near:
        nearest = hits[int(distances.argmin())]
        raise AssertionError(
            f"there was no impulse{_between(geom, other)} within {within:g} m of {_shown(place)}; "
            f"the nearest of {len(hits)} is {distances.min():.4g} m off: {nearest.other!r} gave "
            f"{nearest.geom!r} {nearest.impulse:.4g} N s at {_shown(nearest.point)}"
        )
    total = sum(hit.impulse for hit in near)
    if impulse is not None and not abs(total - impulse) <= rtol * abs(impulse):
        raise AssertionError(
            f"the impulses{_between(geom, other)} within {within:g} m of {_shown(place)} sum up to "
            f"{total:.4g} N s, not {impulse:.4g} N s within {rtol:.2g} of it; there are "
            f"{len(near)}, and {len(hits) - len(near)} elsewhere"
        )
    return near


@checked(
    RippleError,
    waves=instance(WaveSolver, ', for instance ripples["geom"]'),
    within=POSITIVE,
)
def assert_wave_at(waves: WaveSolver, point: ArrayLike, *, within: float) -> None:
    """Assert that the surface is displaced most near a point.

    Parameters
    ----------
    waves : WaveSolver
    point : [3]
        In the world for a target of `Ripples`, in the frame of the mesh for other waves [m].
    within : float
        Greatest distance of the texel with the greatest height or depth [m].

    Raises
    ------
    AssertionError
        If that texel is farther off, or the surface is flat.
    RippleError
        If an argument is invalid.
    """
    (place,) = check_points(point)
    size = np.abs(_not_flat(waves, "height")).reshape(-1)
    positions = waves.atlas.positions.reshape(-1, 3)
    if isinstance(waves, TargetWaves):
        positions = waves.to_world(positions)
    highest = int(size.argmax())
    distance = float(np.linalg.norm(positions[highest] - place))
    if distance > within:
        raise AssertionError(
            f"the surface is displaced most, by {size[highest]:.4g} m, at "
            f"{_shown(positions[highest])}, {distance:.4g} m from {_shown(place)}; at most "
            f"{within:g} m were expected"
        )


@checked(RippleError, tolerance=POSITIVE)
def assert_symmetric(
    waves: WaveSolver,
    *,
    mirror: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    through: ArrayLike | None = None,
    field: str = "height",
    tolerance: float = 0.05,
) -> None:
    """Assert that waves are the same on both sides of a plane, or all round an axis.

    Parameters
    ----------
    waves, mirror, axis, through, field
        As for `asymmetry`.
    tolerance : float
        Greatest `asymmetry`. Interpolation between texels contributes to it: about 0.03 for waves
        of 10 texels, and 0.01 for waves of 20.

    Raises
    ------
    AssertionError
        If the waves are less symmetric, the surface is flat, or the surface itself does not have
        the symmetry.
    RippleError
        If an argument is invalid.
    """
    found = asymmetry(waves, mirror=mirror, axis=axis, through=through, field=field)
    if not found <= tolerance:
        what = "on both sides of the plane" if axis is None else "all round the axis"
        raise AssertionError(
            f"the {field} of the waves is not the same {what}: the differences are {found:.3g} of "
            f"it (root mean squares); at most {tolerance:g} was expected"
        )


@checked(RippleError, waves=instance(WaveSolver, ', for instance ripples["geom"]'))
def asymmetry(
    waves: WaveSolver,
    *,
    mirror: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    through: ArrayLike | None = None,
    field: str = "height",
) -> float:
    """How far waves are from a symmetry: 0 if they have it, about 1.4 if nothing of it is there.

    This is the root mean square, over the area, of the difference between the field at each texel
    and at the texel's image, over the root mean square of the field. The field at the image is
    interpolated linearly. For an axis it is the greatest over turns by sevenths.

    Parameters
    ----------
    waves : WaveSolver
    mirror : [3]
        Normal of a plane on whose sides the waves are to be the same.
    axis : [3]
        Direction of an axis round which the waves are to be the same. Give one of the two.
    through : [3], optional
        Point of the plane or the axis [m]; by default the centroid of the surface's area.
        Directions and the point are in the world for a target of `Ripples`, in the frame of the
        mesh for other waves.
    field : str
        "height" or "velocity".

    Raises
    ------
    AssertionError
        If the field is 0 everywhere, or the surface itself does not have the symmetry.
    RippleError
        If an argument is invalid.
    """
    if (mirror is None) == (axis is None):
        raise RippleError(
            "a symmetry has a plane or an axis; give one of mirror=[x, y, z], the plane's normal, "
            "and axis=[x, y, z]"
        )
    if field not in ("height", "velocity"):
        raise RippleError(f"field must be 'height' or 'velocity', got {field!r}")
    values = _not_flat(waves, field).reshape(-1).astype(np.float64)
    areas = waves.atlas.areas.reshape(-1)
    positions = waves.atlas.positions.reshape(-1, 3)
    centre = areas @ positions / areas.sum() if through is None else _in_frame(waves, through)
    maps = []
    if mirror is not None:
        normal = _direction(waves, mirror, "mirror")
        maps = [np.eye(3) - 2 * np.outer(normal, normal)]
    if axis is not None:
        direction = _direction(waves, axis, "axis")
        maps = [_turn(direction, 2 * np.pi * k / _TURNS) for k in range(1, _TURNS)]
    size = np.sqrt(areas @ values**2)
    differences = [
        np.sqrt(
            areas @ (_at(waves, (positions - centre) @ matrix.T + centre, values) - values) ** 2
        )
        for matrix in maps
    ]
    return float(max(differences) / size)


def _not_flat(waves: WaveSolver, field: str) -> NDArray[np.float32]:
    """A field [C, n, n] that is not 0 everywhere."""
    values = waves.height if field == "height" else waves.velocity
    if not values.any():
        raise AssertionError(f"the {field} of the waves is 0 everywhere: there are none")
    return values


def _at(
    waves: WaveSolver, points: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Values [k] of a flat field at points [k, 3] of the frame of the mesh, on the surface."""
    closest, _ = waves.atlas.nearest(points)
    width = np.sqrt(waves.atlas.areas.mean())
    off = np.linalg.norm(closest - points, axis=1)
    worst = int(off.argmax())
    if off[worst] > _MAX_OFF_SURFACE * width:
        raise AssertionError(
            "the surface itself does not have the symmetry: the image of one of its points is "
            f"{off[worst]:.4g} m off it; give another plane or axis, or a point `through` which it "
            "goes"
        )
    return waves.atlas.sampling_matrix(points) @ values


def _in_frame(waves: WaveSolver, point: ArrayLike) -> NDArray[np.float64]:
    """A point as the user gives it, in the frame of the mesh, [3] [m]."""
    (place,) = check_points(point)
    return waves.from_world(place) if isinstance(waves, TargetWaves) else place


def _direction(waves: WaveSolver, direction: ArrayLike, name: str) -> NDArray[np.float64]:
    """A direction as the user gives it, in the frame of the mesh, as a unit vector [3]."""
    (vector,) = check_points(direction)
    length = np.linalg.norm(vector)
    if length == 0:
        raise RippleError(f"{name} must be a direction, such as [0, 0, 1], got [0, 0, 0]")
    if isinstance(waves, TargetWaves):
        vector = waves.from_world(vector) - waves.from_world(np.zeros(3))
    return vector / np.linalg.norm(vector)


def _turn(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Rotation [3, 3] about a unit vector by an angle [rad]."""
    quaternion = np.zeros(4)
    matrix = np.zeros(9)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _between(geom: str | None, other: str | None) -> str:
    """Which impulses were asked for, in the words of a message."""
    of = "" if other is None else f" by {other!r}"
    return of + ("" if geom is None else f" on {geom!r}")


def _shown(point: NDArray[np.float64]) -> str:
    """A point as messages show it."""
    return "[" + ", ".join(f"{x:.4g}" for x in point) + "] m"
