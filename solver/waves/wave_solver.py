"""The wave solver: impulses and loads in, time steps forward.

How many substeps a step takes.

All that decides how waves go on: what one solver hands to another.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import make_backend
from ..errors import SolverError, checked, instance, shown, whole
from ..files import require_memory
from ..operator.assembly import build_operator
from ..operator.material import Material, warn_of_wavelengths
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from .finite import Source, require_finite
from .load import Load
from .motion import Motion
from .wave_field import WaveSources

# A step that needs more is a mistake in a unit, and would run for ever.
_MOST = 1_000_000
_ONE_OR_MORE = whole(1)


def count_substeps(dt: float, stable: float, asked: int | None) -> int:
    """Number of equal substeps for a step of dt [s], at most `stable` [s] long each.

    Parameters
    ----------
    dt, stable : float
        [s].
    asked : int or None
        How many the caller wants; None: the fewest.

    Raises
    ------
    SolverError
        If the step would take far too many, or fewer are asked for than stability allows.
    """
    ratio = dt / stable * (1 - 1e-12)
    if not ratio < _MOST:
        raise SolverError(
            f"a step of {dt:.4g} s would take {ratio:.3g} substeps of the stable {stable:.4g} s; "
            f"valid are {_MOST} at most: take shorter steps, or a material with slower waves"
        )
    needed = max(1, int(np.ceil(ratio)))
    if asked is None:
        return needed
    if not (_ONE_OR_MORE.holds(asked) and asked <= _MOST):
        raise SolverError(
            f"substeps is {shown(asked)}; valid is {_ONE_OR_MORE.words}, up to {_MOST}, or None for the fewest"
        )
    if asked < needed:
        raise SolverError(
            f"{asked} substeps of {dt / max(asked, 1):.4g} s are longer than the stable {stable:.4g} s; "
            f"use {needed} or more substeps, or leave the number out"
        )
    return asked


@dataclasses.dataclass(frozen=True, eq=False)
class WaveState:
    """The state of a wave solver at a time; see `WaveSolver.state`.

    Attributes
    ----------
    elastic, dent : float32 [C, n, n]
        The part of the height that springs back and the part that stays [m]; the height is their sum.
    velocity : float32 [C, n, n]
        [m/s].
    held : Load
        Forces held until further notice.
    time, substep : float
        [s]; the substep is the latest one, which `energy` needs.
    substeps_taken : int
    """

    elastic: NDArray[np.float32]
    dent: NDArray[np.float32]
    velocity: NDArray[np.float32]
    held: Load
    time: float
    substep: float
    substeps_taken: int


# Memory for each texel while a solver is made, at least [bytes]; half of it is kept.
_TEXEL = 300


class WaveSolver(WaveSources):
    """Waves on the surface of an atlas.

    Time stepping is leapfrog in its drift-kick-drift form with implicit damping: second order, stable up to
    `stable_timestep`, height and velocity at the same time.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    backend : str
        "gl" (compute shaders), "cpu" (numba), or "auto": the faster one, measured once on each machine.
    operator : str
        "fem", or a baseline: "paper", "uncorrected", "dynamic-paint" (see `build_operator`).
    rim : str
        At the rims of an open surface waves come back upright from a "free" one, inverted from a "fixed" one, as on a
        drum skin: there the height is 0, and the moment of a surface that bends. A closed surface has none.
    conserve_volume : bool
        Remove the mean of every source, so that a net push does not move the surface as a whole. On a closed surface
        without stiffness nothing else would stop it; there, the mean is the volume. On an open surface it is the mean
        height. Each part of a mesh, and each region that rigid texels cut off, has a mean of its own. Where the density
        varies, a uniform pressure keeps the volume while the waves run as well, unless something holds the surface: a
        clamp, a fixed rim, or stiffness that varies.

    Raises
    ------
    SolverError
        For invalid names, a material of another type or of another resolution, or too little memory.
    GLError
        If "gl" is asked for and no context can be made.
    """

    @checked(
        SolverError,
        atlas=instance(Atlas, ", from build_atlas or sphere_atlas"),
        material=instance(Material, ", for instance Material(speed=1.0)", optional=True),
    )
    def __init__(
        self,
        atlas: Atlas,
        material: Material | None = None,
        *,
        backend: str = "auto",
        operator: str = "fem",
        rim: str = "free",
        conserve_volume: bool = True,
    ) -> None:
        self.material = material if material is not None else Material()
        what = f"a wave solver of {atlas.areas.size:,} texels"
        require_memory(SolverError, _TEXEL * atlas.areas.size, what, "take an atlas of lower resolution")
        warn_of_wavelengths(atlas, self.material)
        self._kind = operator
        self._begin(atlas, build_operator(atlas, self.material, operator, rim), backend, conserve_volume)

    def _begin(self, atlas: Atlas, operator: WaveOperator, backend: str, conserve_volume: bool) -> None:
        """At rest, at time 0."""
        super().__init__(atlas, operator, make_backend(backend, operator, keeps_volume=conserve_volume))
        self._least_mass = float(operator.mass.min())

    def move(self, V: ArrayLike) -> None:
        """Move the surface: the texels ride on their triangles, at their barycentric coordinates.

        Each texel keeps its mass, so that the surface gets thinner where it stretches, and its height and velocity,
        along the normal that it has then. Stiffness and stable time step follow the lengths on the surface as soon as
        one changes by a part in 1,000; a motion that leaves them as they are changes nothing. Speed and rates stay the
        material's own, but for its `tightening`. The motion itself neither pushes the waves nor feels them.

        Parameters
        ----------
        V : float64 [vertex_count, 3]
            Where the vertices of `atlas.mesh` are now [m].

        Raises
        ------
        SolverError
            If they are not finite, or not as many as the mesh has; for a baseline operator, or deep fluid.
        """
        if self._motion is None:
            if self._kind != "fem":
                raise SolverError(f"a surface with the operator {self._kind!r} cannot move; valid is 'fem'")
            self._motion = Motion(self._rest, self.material, self.operator)
        operator = self._motion.to(V)
        if operator is not None:
            self.operator = operator
            self._backend.move(operator)

    def __getstate__(self) -> tuple[Any, ...]:
        """What `copy` and `pickle` keep: a copy goes on as the original does, bit for bit."""
        made_of = self._rest, self.material, self._kind, self.operator, self._motion
        return made_of, self.backend, self.conserve_volume, self.state

    def __setstate__(self, kept: tuple[Any, ...]) -> None:
        (atlas, self.material, self._kind, operator, motion), backend, conserve_volume, state = kept
        self._begin(atlas, operator, backend, conserve_volume)
        self._motion = motion
        self.state = state

    @property
    def state(self) -> WaveState:
        """All that decides how the waves go on, but for atlas and material; assign it to another solver.

        Assigning raises `SolverError` for a state of another resolution. Where the solver's own material clamps the
        surface or carries no waves, it takes over dents alone, and comes to rest.
        """
        backend = self._backend
        return WaveState(
            self._finite(backend.elastic(), "height"),
            self.dent,
            self.velocity,
            self._held.load,
            self.time,
            self._substep,
            self.substeps_taken,
        )

    @state.setter
    def state(self, state: WaveState) -> None:
        shape = self.operator.mass.shape
        if state.elastic.shape != shape:
            raise SolverError(f"the state of waves has shape {state.elastic.shape}; valid is {shape}")
        self._backend.set_height(state.elastic * self.operator.free, state.dent)
        self._backend.set_velocity(state.velocity * self.operator.movable)
        self._held.load = state.held
        self.time, self._substep, self.substeps_taken = state.time, state.substep, state.substeps_taken
        self._guard.clear()
        self._note_height(state.elastic)
        self._note_velocity(state.velocity)

    @property
    def stable_timestep(self) -> float:
        """Longest substep that is stable [s]."""
        return self.operator.stable_timestep

    def step(self, dt: float, substeps: int | None = None, load: Load | None = None) -> None:
        """Advance by dt [s] in equal substeps, as many as stability asks for.

        Parameters
        ----------
        dt : float
            [s].
        substeps : int, optional
            How many, instead of the fewest.
        load : Load, optional
            Forces that act over this step alone, beside those that are held.

        Raises
        ------
        SolverError
            If dt is negative or not finite, a given number of substeps is too small to be stable, a load is not finite
            or names no texel, or the height is no longer finite: the CPU looks at it every 32 substeps, and both
            backends look at whatever is read.
        """
        require_finite("time step", dt, "s", least=0.0)
        if dt == 0:
            return
        substeps = count_substeps(dt, self.stable_timestep, substeps)
        self._substep = dt / substeps
        # values too large for float32 become infinite here; the next look reports them
        with np.errstate(over="ignore", invalid="ignore"):
            force = self._held.upload(load, self._counterpart)
            self._backend.advance(substeps, self._substep)
        if force is not None:
            self._guard.note(Source("forces", force, "N", self.time, abs(force) * dt / self._least_mass))
        self.time += dt
        self.substeps_taken += substeps
        if self._guard.due(substeps) and not self._backend.finite():
            self._finite(self._backend.height(), "height")

    def reset(self) -> None:
        """Flatten the surface, end all pressure, and set the time back to 0."""
        shape = self.operator.mass.shape
        self.height = np.zeros(shape, np.float32)
        self.velocity = np.zeros(shape, np.float32)
        self.pressure = 0.0
        self.time, self.substeps_taken = 0.0, 0
        self._guard.clear()
