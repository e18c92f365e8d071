"""The wave solver: impulses and loads in, time steps forward, heights out."""

from __future__ import annotations

import copy
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import Backend
from ..backends.choice import make_backend
from ..backends.crews import checked_threads
from ..backends.gl_fields import DeviceField
from ..errors import SolverError, checked, instance
from ..memory import require_memory
from ..operator.assembly import build_operator
from ..operator.material import Material, warn_of_wavelengths
from ..operator.plate_rim import Rim
from ..operator.volume import VolumeBalance, balanced_parts, kept_parts
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from .finite import FiniteGuard, as_field, check_kick, count_substeps, require_finite
from .footprint import Footprint, spread
from .load import HeldLoad, Load, StepLoad, WaveState
from .motion import Motion
from .press import Imprint, Stamps
from .sensor import Listeners, Sensor
from .tape import RecordedBackend, Tape

# Memory that a solver takes for each texel while it is made, at least [bytes]; it keeps half of it.
_TEXEL_BYTES = 300


class WaveSolver:
    """Waves on the surface of an atlas.

    Time stepping is leapfrog in its drift-kick-drift form with implicit damping: second order,
    stable up to `stable_timestep`, height and velocity at the same time.

    Parameters
    ----------
    atlas : Atlas
    material : Material
    backend : str
        "gl" (compute shaders), "cpu" (numba), or "auto": the faster one, measured once on each
        machine.
    operator : str
        "fem", or a baseline: "paper", "uncorrected", "dynamic-paint" (see `build_operator`).
    rim : str or callable
        At the rims of an open surface waves come back upright from a "free" one, inverted from a
        "supported" one (its height is 0, as on a drum skin) and a "clamped" one (nor does a surface
        that bends have a slope). A function of points on the rim [k, 3] gives a name for each, or
        whether it is clamped, else free. "fixed": as "supported", but plates are held as if
        Poisson's ratio were 1, which is the same at straight edges.
    conserve_volume : bool, optional
        Remove the mean of every source, so that a net push does not move the surface as a whole. By
        default the mean is removed from closed surfaces, whose mean height is the volume of an
        incompressible body, and from open surfaces that nothing holds, whose mean height nothing
        else would stop. The mean stays on open surfaces that a rim, a clamp, or stiffness anywhere
        holds. True: remove the mean from all surfaces; False: from none. Each part of a mesh, and
        each region that rigid texels cut off, has its own mean, and is held or not by itself. Where
        the density varies, a uniform pressure also keeps the volume while the waves run, unless
        something holds the surface: a clamp, a fixed rim, or stiffness that varies. Deep fluid
        always keeps its volume.
    threads : int, optional
        Threads of the backend "cpu". By default as many as the process has cores where the surface
        is so large that threads pay, from 200,000 texels on; the environment variable
        `RIPPLE_SIM_THREADS` sets another default. The heights are the same, bit for bit, with any
        number. Plates with curvatures at rims, volumes that are kept at uneven density, and deep
        fluid are stepped by one thread.

    Attributes
    ----------
    rest : Atlas
        The surface before it moved.
    operator : WaveOperator
    time : float
        [s].
    substeps_taken : int
    listeners : Listeners
        Sensors, and other listeners that hear of every substep.

    Raises
    ------
    SolverError
        For invalid names, a material of another type or of another resolution, or too little
        memory.
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
        rim: Rim = "free",
        conserve_volume: bool | None = None,
        threads: int | None = None,
    ) -> None:
        self._threads = checked_threads(threads)
        self.material = material if material is not None else Material()
        require_memory(
            SolverError,
            _TEXEL_BYTES * atlas.areas.size,
            f"a wave solver of {atlas.areas.size:,} texels",
            "take an atlas of lower resolution",
        )
        warn_of_wavelengths(atlas, self.material)
        self._kind = operator
        wave_operator = build_operator(atlas, self.material, operator, rim)
        self._begin(atlas, wave_operator, backend, conserve_volume)

    def _begin(
        self, atlas: Atlas, operator: WaveOperator, backend: str, conserve_volume: bool | None
    ) -> None:
        """Begin at rest, at time 0."""
        self.rest = atlas
        self.operator = operator
        self._motion: Motion | None = None
        self.time = 0.0
        self.substeps_taken = 0
        self._substep = 0.0
        self._backend = make_backend(
            backend, operator, keeps_volume=conserve_volume, threads=self._threads
        )
        self._balance = VolumeBalance(operator, conserve_volume)
        self._held = HeldLoad(self._backend, operator.source_share, self._balance)
        self._guard = FiniteGuard(atlas.positions)
        self._stamps = Stamps()
        self.listeners = Listeners(self._backend)
        self._least_mass = float(operator.mass.min())

    @property
    def atlas(self) -> Atlas:
        """The surface where it is now."""
        return self.rest if self._motion is None else self._motion.atlas

    @property
    def vertices(self) -> NDArray[np.float64] | None:
        """Vertices as `WaveSolver.move` left them [m], [vertex_count, 3]; None before it moves."""
        return None if self._motion is None else self._motion.V

    @property
    def backend(self) -> str:
        """Backend that runs: "gl" or "cpu"."""
        return self._backend.name

    @property
    def stable_timestep(self) -> float:
        """Longest substep that `step` chooses [s].

        It is stable, and springs oscillate within 0.5 % of their rate.
        """
        return self.operator.longest_timestep

    def step(self, dt: float, substeps: int | None = None, load: StepLoad | None = None) -> None:
        """Advance by dt [s] in equal substeps, each at most `stable_timestep` long.

        Parameters
        ----------
        dt : float
            [s].
        substeps : int, optional
            How many, instead of the fewest.
        load : Load, optional
            Forces that act over this step alone, beside the forces that are held; or a load that
            changes within the step, see `StepLoad`.

        Raises
        ------
        SolverError
            If dt is negative or not finite, a given number of substeps is too small to be stable, a
            load is not finite or names no texel, or the height is no longer finite: the CPU looks
            at it every 32 substeps, and both backends check every value that is read.
        """
        require_finite("time step", dt, "s", least=0.0)
        if dt == 0:
            return
        longest = self.stable_timestep if substeps is None else self.operator.stable_timestep
        substeps = count_substeps(dt, longest, substeps)
        begin = self.time
        self._substep = dt / substeps
        loads = [(substeps, None)] if load is None else load.parts(dt, substeps)
        for count, constant_load in loads:
            # values too large for float32 become infinite here; the next check reports them
            with np.errstate(over="ignore", invalid="ignore"):
                force = self._held.upload(constant_load)
                self._backend.advance(count, self._substep)
            if force is not None:
                self._guard.note("forces", force, "N", begin, abs(force) * dt / self._least_mass)
            if self.listeners.all:
                self.listeners.hear(begin, self._substep)
            begin += count * self._substep
        self.time += dt
        self.substeps_taken += substeps
        if self._guard.due(substeps) and not self._backend.finite():
            self._finite(self._backend.fields.height(), "height")

    def reset(self) -> None:
        """Flatten the surface, end all pressure, and set the time back to 0."""
        self.height = 0.0
        self.velocity = 0.0
        self.pressure = 0.0
        self.time = 0.0
        self.substeps_taken = 0
        self._guard.clear()
        self.listeners.begin(self.time)

    def sensor(
        self,
        at: str | ArrayLike,
        kind: str = "acceleration",
        rate: float = 48_000,
        *,
        thickness: float | None = None,
    ) -> Sensor:
        """Measure the surface from now on, along its normal, after every substep; see `Sensor`.

        Parameters
        ----------
        at : [3], [k, 3] or str
            Points in the frame of the mesh [m]; the nearest surface points are taken. In `Ripples`
            also a site's name.
        kind : str
            "acceleration" [m/s^2], "velocity" [m/s], "height" [m], or "strain" of a bent sheet's
            outer face.
        rate : float
            Samples a second [1/s].
        thickness : float, optional
            Of the sheet [m], for "strain" alone.
        """
        if isinstance(at, str):
            if self.listeners.find_points is None:
                raise SolverError(
                    f"sensor at {at!r}: this surface knows no names; give points, [3] or [k, 3]"
                )
            at = self.listeners.find_points(at)
        sensor = Sensor(self.atlas, self.material, self.operator, at, kind, rate, thickness)
        return self.listeners.add(sensor, self.time)

    def record(self, tape: Tape) -> None:
        """Write everything that drives the waves from now on to a tape, until `forget`."""
        if not isinstance(self._backend, RecordedBackend):
            recorded = RecordedBackend(self._backend)
            self._backend = self._held.backend = cast(Backend, recorded)
        recorded = cast(RecordedBackend, self._backend)
        recorded.tapes.append(tape)
        self._held.upload_again()  # so that the tape begins with the load that is held

    def forget(self, tape: Tape) -> None:
        """End the recording to a tape."""
        if isinstance(self._backend, RecordedBackend) and tape in self._backend.tapes:
            self._backend.tapes.remove(tape)

    def move(self, V: ArrayLike) -> None:
        """Move the surface: the texels ride on their triangles, at their barycentric coordinates.

        Each texel keeps its mass, so that the surface gets thinner where it stretches. It keeps its
        height and velocity, along its normal after the motion. Stiffness and stable time step
        follow the lengths on the surface as soon as a length changes by a part in 1,000; a motion
        that keeps all lengths changes nothing. Speed and rates stay those of the material, except
        for its `tightening`. The motion itself neither pushes the waves nor feels them.

        Parameters
        ----------
        V : float64 [vertex_count, 3]
            Where the vertices of `atlas.mesh` are now [m].

        Raises
        ------
        SolverError
            If the vertices are not finite, or not as many as the mesh has; for a baseline operator,
            or deep fluid.
        """
        if self._motion is None:
            if self._kind != "fem":
                raise SolverError(
                    f"a surface that moves must have the operator 'fem', got {self._kind!r}"
                )
            self._motion = Motion(self.rest, self.material, self.operator)
        operator = self._motion.to(V)
        if operator is not None:
            self.operator = operator
            self._backend.move(operator)

    @property
    def conserve_volume(self) -> bool:
        """Whether the mean of sources is removed on any part of the surface.

        Assign True or False for all parts, or None for the default of each, also while the waves
        run.
        """
        return bool(self.kept_parts.any())

    @conserve_volume.setter
    def conserve_volume(self, value: bool | None) -> None:
        self._backend.keeps_volume = value
        self._held.balance = self._balance = VolumeBalance(self.operator, value)

    @property
    def kept_parts(self) -> NDArray[np.bool_]:
        """Whether the mean of sources is removed, for each part of the surface, [p]."""
        return kept_parts(self.operator, self._backend.keeps_volume)

    @property
    def balanced_parts(self) -> NDArray[np.bool_]:
        """Whether a pressure keeps the volume of each part while its waves run, [p]."""
        return balanced_parts(self.operator, self._backend.keeps_volume)

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Pressure held over `step` [Pa], positive inwards, float64 [C, n, n].

        It is a copy that includes the forces of `add_force`. Assign to change the pressure, 0 to
        end it.
        """
        return self._held.forces() / self._areas

    @pressure.setter
    def pressure(self, value: ArrayLike) -> None:
        self._held.load = Load.none()
        self.add_pressure(value)

    def add_impulse(self, point: ArrayLike, impulse: float, radius: float) -> Footprint:
        """Press on the surface for an instant.

        Parameters
        ----------
        point : [3]
            Where [m], in the frame of the mesh; the nearest surface point is taken.
        impulse : float
            J [N s]. Positive presses inwards: the sum of sigma A dv over the texels is -J (before
            the mean is removed, where volume is conserved). The part on clamped or rigid texels is
            lost to what supports them.
        radius : float
            Footprint radius [m], along the surface; at least two texels are used.

        Returns
        -------
        Footprint
            The texels that were hit.

        Raises
        ------
        SolverError
            If the impulse or the radius is not finite, the radius is negative, there are several
            points, or the velocity is beyond float32.
        """
        where, impulses = spread(self.atlas, "impulse", impulse, "N s", point, radius)
        momentum = -impulses * self.operator.source_share.reshape(-1)[where.texels]
        velocities = momentum / self.operator.mass.reshape(-1)[where.texels]
        self._guard.note("impulse", impulse, "N s", self.time, check_kick(velocities, impulse))
        # sums too large for float32 become infinite here; a later check reports them
        with np.errstate(over="ignore"):
            balance = self._held.counterpart(where.texels, momentum)
            self._backend.kick(where.texels, velocities.astype(np.float32), balance)
        return where

    def add_force(self, point: ArrayLike, force: float, radius: float) -> Footprint:
        """Press on the surface from now on, until `pressure` is assigned.

        Parameters
        ----------
        point : [3]
            Where [m], in the frame of the mesh; the nearest surface point is taken.
        force : float
            [N], positive inwards.
        radius : float
            Footprint radius [m], along the surface; at least two texels are used.

        Raises
        ------
        SolverError
            If the force or the radius is not finite, the radius is negative, or there are several
            points.
        """
        where, forces = spread(self.atlas, "force", force, "N", point, radius)
        self._held.add(Load(where.texels, forces))
        return where

    def press(
        self,
        points: ArrayLike,
        *,
        forces: ArrayLike | None = None,
        depths: ArrayLike | None = None,
        radius: float = 0.0,
    ) -> Imprint:
        """Find how the surface lies at rest under what presses on it; the waves stay as they are.

        Dents do not count. The first call factorises a matrix, and the first call with `depths`
        solves for every point; calls with the same points and radius are much faster.

        Parameters
        ----------
        points : [k, 3]
            Where [m], in the frame of the mesh; the nearest surface points are taken.
        forces : float or [k]
            Forces at the points [N], positive inwards.
        depths : float or [k]
            How far a body reaches into the surface at the points [m], as MuJoCo's `tactile` sensor
            tells; 0 and less where it does not. The forces follow: they press, and never pull.
        radius : float
            Radius of each point's footprint [m], along the surface; at least two texels are used.

        Returns
        -------
        Imprint
            Displacement, pressure, and the force at each point.

        Raises
        ------
        SolverError
            If nothing holds the surface: stiffness, a supported or clamped rim, or a volume that is
            kept. If not exactly one of `forces` and `depths` is given, or they or the radius are
            not finite.
        AtlasError
            If the points are not finite.
        """
        if (forces is None) == (depths is None):
            raise SolverError("press takes either forces or depths, got both or neither")
        stamp = self._stamps.stamp(self.atlas, self.operator, self.kept_parts, points, radius)
        if depths is not None:
            return stamp.press_to(depths)
        assert forces is not None
        return stamp.press(forces)

    def add_pressure(self, pressure: ArrayLike) -> None:
        """Add a pressure [Pa] that is held from now on: a number or [C, n, n], positive inwards."""
        field = as_field(pressure, "pressure", self.operator.mass.shape)
        force = (field * self._areas).reshape(-1)
        texels = np.flatnonzero(force)
        self._held.add(Load(texels, force[texels]))

    def add_height(self, height: ArrayLike) -> None:
        """Raise the surface by a field [m], [C, n, n].

        Where volume is conserved, the field's mean over the area is removed.
        """
        field = as_field(height, "height", self.operator.mass.shape).astype(np.float64)
        field = self._balance.balanced_height(field * self.operator.free, self._areas)
        self._note("height", field)
        elastic = self._backend.fields.elastic_height() + field.astype(np.float32)
        self._backend.fields.set_height(elastic, self._backend.fields.permanent_height())

    def add_velocity(self, velocity: ArrayLike) -> None:
        """Add a field [m/s], [C, n, n], to the velocity.

        Where volume is conserved, the field's volume rate is removed.
        """
        field = as_field(velocity, "velocity", self.operator.mass.shape).astype(np.float64)
        field = self._balance.balanced_velocity(field * self.operator.movable)
        self._note("velocity", field)
        self._backend.set_velocity(self._backend.velocity() + field.astype(np.float32))

    @property
    def height(self) -> NDArray[np.float32]:
        """Displacement along the outward normal [m], float32 [C, n, n].

        It is a copy; assign to change the height. `waves.height = field` and `waves.height +=
        field` work, also with one number; `waves.height[0] = x` changes the copy only. An assigned
        height is elastic: dents are removed.

        Reading raises `SolverError` once if a height is no longer finite.
        """
        return self._finite(self._backend.fields.height(), "height")

    @height.setter
    def height(self, value: ArrayLike) -> None:
        height = as_field(value, "height", self.operator.mass.shape) * self.operator.free
        self._note("height", height)
        self._backend.fields.set_height(height)

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of each height since the last call [m], [C, n, n].

        It counts after every `step`, and now, from the first call on. A copy of the solver begins
        anew. Raises `SolverError` as `height` does.
        """
        return self._finite(self._backend.crests(), "height")

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """A copy of the height [m], [C, n, n]; with hardware GL it stays on the GPU.

        `numpy.asarray` gives an array; `HeightMap` takes both.
        """
        heights = self._backend.snapshot()
        return self._finite(heights, "height") if isinstance(heights, np.ndarray) else heights

    @property
    def dent(self) -> NDArray[np.float32]:
        """Permanent part of the height [m], float32 [C, n, n]; 0 unless the material yields."""
        return self._finite(self._backend.fields.permanent_height(), "dent")

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Rate of the height [m/s], float32 [C, n, n]: a copy; assign to change the velocity.

        Reading raises `SolverError` once if a velocity is no longer finite. The velocity may be
        infinite before the height is.
        """
        return self._finite(self._backend.velocity(), "velocity")

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        velocity = as_field(value, "velocity", self.operator.mass.shape) * self.operator.movable
        self._note("velocity", velocity)
        self._backend.set_velocity(velocity)

    def energy(self) -> float:
        """Kinetic plus potential energy [J] of the discrete system.

        It is 1/2 v' (M - dt^2/4 K) v + 1/2 h' K h, with dt the latest substep and K all elastic
        forces. Without damping, the leapfrog scheme conserves this energy to round-off while the
        substep stays the same. It differs from the continuous energy by O(dt^2). Energy spent on
        dents is not included.
        """
        elastic = self._finite(self._backend.fields.elastic_height(), "height")
        height = elastic.astype(np.float64)
        velocity = self.velocity.astype(np.float64)
        with np.errstate(invalid="ignore"):  # NaN says enough
            kinetic = float((self.operator.momenta(velocity) * velocity).sum()) / 2
            potential = self._elastic_energy(height)
            return kinetic + potential - self._substep**2 / 4 * self._elastic_energy(velocity)

    def _elastic_energy(self, field: NDArray[np.float64]) -> float:
        """1/2 x' K x of a field x [C, n, n]."""
        return -float((field * self.operator.elastic_force(field)).sum()) / 2

    def volume(self) -> float:
        """Volume that the waves add [m^3], to first order: sum of area times height."""
        return float((self._areas * self.height.astype(np.float64)).sum())

    def momentum(self) -> float:
        """Sum of sigma A v [kg m/s], positive outwards."""
        return float((self.operator.mass * self.velocity.astype(np.float64)).sum())

    def __getstate__(self) -> tuple[Any, ...]:
        """The state for `copy` and `pickle`: a copy continues like the original, bit for bit."""
        surface = self.rest, self.material, self._kind, self.operator, copy.copy(self._motion)
        return surface, self.backend, self._backend.keeps_volume, self._threads, self.state

    def __setstate__(self, pickled: tuple[Any, ...]) -> None:
        surface, backend, conserve_volume, self._threads, state = pickled
        atlas, self.material, self._kind, operator, motion = surface
        self._begin(atlas, operator, backend, conserve_volume)
        self._motion = motion
        self.state = state

    @property
    def state(self) -> WaveState:
        """Everything needed to continue the simulation, except the atlas and the material.

        Assign it to another solver. Assigning raises `SolverError` for a state of another
        resolution. Where the solver's own material clamps the surface or carries no waves, only
        dents are taken over, and the surface is at rest.
        """
        elastic = self._finite(self._backend.fields.elastic_height(), "height")
        clock = self.time, self._substep, self.substeps_taken
        return WaveState(elastic, self.dent, self.velocity, self._held.load, *clock)

    @state.setter
    def state(self, state: WaveState) -> None:
        shape = self.operator.mass.shape
        if state.elastic.shape != shape:
            raise SolverError(
                f"the state of waves must have shape {shape}, got {state.elastic.shape}"
            )
        self._backend.fields.set_height(state.elastic * self.operator.free, state.dent)
        self._backend.set_velocity(state.velocity * self.operator.movable)
        self._held.load = state.held
        self.time = state.time
        self._substep = state.substep
        self.substeps_taken = state.substeps_taken
        self._guard.clear()
        self.listeners.begin(self.time)
        self._note("height", state.elastic)
        self._note("velocity", state.velocity)

    @property
    def _areas(self) -> NDArray[np.float64]:
        return self.rest.areas if self._motion is None else self._motion.areas

    def _finite(self, field: NDArray[np.float32], name: str) -> NDArray[np.float32]:
        """Return a field after it was checked; see `FiniteGuard.check`."""
        self._guard.check(field, name, self.time)
        return field

    def _note(self, kind: str, field: NDArray) -> None:
        """Tell the guard, and tapes, of a height or a velocity that was assigned or added."""
        if isinstance(self._backend, RecordedBackend):
            self._backend.break_off("has heights or velocities that the program assigns")
        unit, time = ("m", self.operator.stable_timestep) if kind == "height" else ("m/s", 1.0)
        largest = float(np.abs(field).max())
        self._guard.note(kind, largest, unit, self.time, largest / time)
