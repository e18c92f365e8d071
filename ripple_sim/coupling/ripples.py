"""`Ripples` adds rippling surfaces to any MuJoCo loop: contact forces become waves."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Load, Material, SolverError
from ripple_sim.solver.errors import checked, warn_caller, whole
from ripple_sim.solver.mesh.points import check_points
from ripple_sim.solver.operator.plate_rim import Rim
from ripple_sim.solver.waves.footprint import Footprint, footprint
from ripple_sim.solver.waves.sensor import Sensor

from .amplitude_check import AmplitudeCheck
from .collision_geoms import named_collision_geoms
from .easing import Easing, bodies_of, easing_warning
from .energy import Energy, body_energy
from .geoms import ByGeom, GeomKey, find_any, rotation_in_body, target_name
from .hertz import Hits, hertz_moduli
from .high_pass import HighPass
from .hooks import adopt_warnings, followed
from .ids import GeomId, TargetId, is_geom
from .load import ContactLoads, Impulse
from .model import CoupledModel
from .own_model import own_data, own_model
from .rippling import RipplingSurface, rippling_surfaces
from .sensor_data import SensorData
from .solved_forces import SolvedForces
from .stepping import (
    IN_TURN_WARNING,
    NO_RESET,
    StepClock,
    disabled_warning,
    divergence,
    divergence_warning,
    missed_warning,
    physics_errors,
)
from .target import ForTargets, Target, contacts_of, named_targets
from .target_warnings import collision_warnings
from .target_waves import Surface, TargetWaves, Whereabouts
from .tunnelling import TunnellingCheck
from .two_way import TwoWay, require_suited_options

__all__ = ["Impulse", "Ripples"]

# How far off the surface a poke may be without a warning, over the object's size.
_MAX_POKE_DISTANCE = 0.1


class Ripples:
    """Ripples on geoms of a MuJoCo model, driven by its contact forces.

    Call `step(data)` after each `mujoco.mj_step(model, data)`, or `mj_step(data)` instead of both.
    From now on MuJoCo's warnings are given as `RippleWarning`, unless `mujoco.set_mju_user_warning`
    was told otherwise.

    Parameters
    ----------
    model : mujoco.MjModel
        Or dm_control's wrapper of one; likewise the data of each step.
    materials : mapping
        Geom to its `Material`, or to a `Target`, which also says how the waves of this geom are
        solved. A geom is given by its name, by "body/index" (its index among the geoms of its
        body), or by its id. Geoms of type mesh, sdf, hfield, sphere, ellipsoid, capsule,
        cylinder and box can ripple, and flexes and skins, by their names. MuJoCo collides a mesh
        geom as its convex hull. A geom of type="sdf" collides as the true surface, and so does a
        mesh geom with a rigid flex of the same name on the same body, which collides in its place;
        see `make_collidable`. Impulses are exact with every integrator except RK4. For a material
        without a density, the model chooses the density, and the speed, damping and stiffness if
        they are not given either; see `suited_material`. The chosen values are in
        `ripples[geom].material`, and forces of bodies too heavy for them are eased, see `Easing`.
    resolution : int, optional
        Texels along an edge of the atlas's charts. None: 32 to 256, by what touches the target and
        by the time step, see `suited_resolution`. This argument and the following ones hold for all
        targets whose `Target` leaves them open. Mappings of values by geom still work, and are
        deprecated.
    layout : str
        How surfaces get their charts: "auto", "cube" or "patches"; see `build_atlas`.
    rim : str or callable
        "free", "supported", "clamped" or "fixed" rims of open surfaces, or a function of their
        points in the geom's frame; see `WaveSolver`.
    two_way : bool
        Let surfaces give way to the bodies that touch them, and push back on those within reach of
        them while risen. Each `step` finds the contact forces of the latest physics step anew, with
        the motion of both, and corrects `data.qvel` and `data.qpos`; `xfrc_applied` and the other
        applied forces in `data` are yours alone. The integrator RK4 is refused. See "Two-way
        coupling" in how-it-works.md.
    contacts : mapping, optional
        Geom to the geoms that collide for it. Deprecated: use `Target(contacts=...)`.
    high_pass : bool
        Whether a flex keeps the coarse motion that contacts give it to itself. Its waves then get
        only the part that the flex cannot follow, see `HighPass`. Otherwise the momentum of a
        contact counts twice: in the flex and in its waves.
    pulse : str
        How long a hit takes: "contact", as MuJoCo's soft contact holds it, some
        milliseconds, or "hertz", as two elastic bodies touch, with the same impulse; see `Hits`.
    modulus : float, optional
        For "hertz": E* of the two materials, 1 / E* = (1 - nu1^2) / E1 + (1 - nu2^2) / E2 [Pa].
    backend : str
        As for `WaveSolver`; so are the next two.
    operator : str
    conserve_volume : bool, optional
        Whether the mean of every push is taken out. By default on closed surfaces, and on
        open ones that no rim, clamp or stiffness holds.

    Raises
    ------
    SceneError
        For an unknown geom or one that cannot ripple, a geom without a material or resolution, or
        invalid contacts.
    RippleError
        If a geom's mesh does not suit the layout, or a wave parameter is invalid.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        materials: ByGeom[Material | Target] | ByGeom[Material] | ByGeom[Target],
        *,
        resolution: ForTargets[int | None] = None,
        layout: ForTargets[str] = "auto",
        rim: ForTargets[Rim] = "free",
        two_way: bool = False,
        contacts: ByGeom[Sequence[GeomKey]] | None = None,
        high_pass: ForTargets[bool] = False,
        pulse: ForTargets[str] = "contact",
        modulus: ForTargets[float | None] = None,
        backend: str = "auto",
        operator: str = "fem",
        conserve_volume: ForTargets[bool | None] = None,
    ) -> None:
        self.model = own_model(model)
        common = {
            "resolution": resolution,
            "layout": layout,
            "rim": rim,
            "high_pass": high_pass,
            "pulse": pulse,
            "modulus": modulus,
            "conserve_volume": conserve_volume,
        }
        targets = named_targets(self.model, materials, common)
        options = {"backend": backend, "operator": operator}
        # surfaces that push back, and pulses of hits, need the whole force
        can_ease = not two_way and all(target.pulse == "contact" for target in targets.values())
        self._whereabouts = Whereabouts(self.model)
        self._surfaces, self._easings = rippling_surfaces(
            self.model, targets, options, self._whereabouts, can_ease
        )
        # by target; all who load or read the waves share this dictionary, and so see new waves as
        # soon as it has them
        self._waves = {surface.id: surface.waves for surface in self._surfaces.values()}
        adopt_warnings()
        self._contacts = named_collision_geoms(self.model, self, contacts_of(targets, contacts))
        self._moduli = hertz_moduli(self.model, targets)
        self._has_high_pass = {name: bool(target.high_pass) for name, target in targets.items()}
        self._has_two_way = two_way
        coupled = self._couple(None)
        rigid_targets = self._rigid_targets()
        self._check_tunnelling = TunnellingCheck(coupled, rigid_targets)
        for geom in rigid_targets:
            for message in collision_warnings(coupled, geom, self._waves[geom].atlas):
                warn_caller(message)
        self._check_options(coupled)
        for name, target in targets.items():
            if not target.limit:
                self.allow_any_height(name)
        self._scratch = mujoco.MjData(self.model)
        self._clock = StepClock()
        self._solved = SolvedForces(self.model)
        self._sensor_data = SensorData(self.model, self._waves)
        self._warned: set[str] = set()

    def _check_options(self, coupled: CoupledModel) -> None:
        """Refuse options that do not go together, and warn of the integrator RK4."""
        if self._has_two_way and self._moduli:
            raise SceneError(
                "with two_way the surface itself says how long a hit takes; take two_way=False, or "
                "pulse='contact'"
            )
        if self._has_two_way and coupled.soft:
            raise SceneError(
                "flexes and skins cannot push back: their waves have the masses that their nodes "
                "and bones have already; take two_way=False, or geoms as targets alone"
            )
        if self._has_two_way:
            require_suited_options(self.model)
        if self._waves and self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            warn_caller(
                "the integrator RK4 averages four contact forces in each step, of which MuJoCo "
                "keeps only the last: impulses are off by some per cent; use "
                'integrator="implicitfast", or a short time step'
            )

    def __getitem__(self, name: GeomKey) -> TargetWaves:
        """Waves of a geom, by name or id."""
        return self._surface(name).waves

    def __iter__(self) -> Iterator[str]:
        return iter(self._surfaces)

    def __len__(self) -> int:
        return len(self._surfaces)

    @property
    def geom_ids(self) -> dict[str, TargetId]:
        """Id of every target, by name: the geom's; a flex or a skin has one after all geoms."""
        return {name: surface.id for name, surface in self._surfaces.items()}

    def change_material(self, name: GeomKey, **coefficients: Any) -> None:
        """Change coefficients of a geom's material, by their names in `Material`.

        Height and velocity of the waves stay.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            For an unknown or invalid coefficient.
        """
        names = [field.name for field in dataclasses.fields(Material)]
        for coefficient in coefficients:
            if coefficient not in names:
                raise SolverError(
                    f"a material has no coefficient {coefficient!r}; coefficients are "
                    f"{', '.join(names)}"
                )
        material = dataclasses.replace(self._surface(name).material, **coefficients)
        self._change(name, material=material)
        if "density" in coefficients:
            self._take_up_all(self._surface(name).id)

    def poke(
        self, name: GeomKey, point: ArrayLike, impulse: float, radius: float = 0.0
    ) -> Footprint:
        """Give a geom's surface an impulse at once, as `[[poke]]` in a scene file does.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom's body, as places in an MJCF are [m]; the nearest surface point
            is taken, with a warning where that is far.
        impulse : float
            [N s]; positive presses inwards.
        radius : float
            Of the footprint, along the surface [m]; at least two texels are used.

        Returns
        -------
        Footprint
            The texels that were hit.

        Raises
        ------
        SceneError
            For an unknown geom.
        SolverError
            If the impulse, the point or the radius is not finite, or the radius negative.
        """
        waves = self._surface(name).waves
        place = self.to_geom(name, point)
        hit = waves.add_impulse(place, impulse, radius)
        distance = float(np.linalg.norm(place - hit.point))
        size = float(np.ptp(waves.atlas.mesh.V, axis=0).max())
        if distance > _MAX_POKE_DISTANCE * size:
            warn_caller(
                f"a poke of {name!r} is {distance:.3g} m off its surface ({distance / size:.0%} of "
                "its size); the nearest point is poked. Points are in the frame of the geom's body "
                "[m]"
            )
        return hit

    def make_rigid(self, name: GeomKey, point: ArrayLike, radius: float) -> None:
        """Hold a disc of a geom's surface still.

        Waves go round it, and contacts there move nothing.

        Parameters
        ----------
        name : str or int
            Geom.
        point : [3]
            In the frame of the geom's body [m]; the nearest surface point is taken.
        radius : float
            Along the surface [m].
        """
        atlas = self._surface(name).waves.atlas
        texels = footprint(atlas, self.to_geom(name, point), radius).texels
        disc = np.zeros(atlas.areas.shape)
        disc.reshape(-1)[texels] = 1.0
        self.hold(name, disc)

    def hold(self, name: GeomKey, region: ArrayLike) -> None:
        """Hold a region of a geom's surface still, as `make_rigid` does with a disc.

        Parameters
        ----------
        name : str or int
            Geom.
        region : bool or float [C, n, n]
            The texels to hold; from 0 to 1 for a share of a texel.

        Raises
        ------
        SolverError
            If the region has another shape, or numbers that are not from 0 to 1.
        """
        held_before = self._surface(name).held
        try:
            held = np.asarray(region, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SolverError(
                f"region must be numbers from 0 to 1, one for each texel, got {region!r}"
            ) from error
        if held_before is not None and held.shape == held_before.shape:
            held = np.maximum(held, held_before)
        self._change(name, held=held)

    def change_operator(self, operator: str) -> None:
        """Change the wave operator on all surfaces, by its name in `WaveSolver`.

        Height and velocity of the waves stay. Raises `SolverError` for an unknown operator.
        """
        for name, surface in list(self._surfaces.items()):
            self._change(name, options={**surface.options, "operator": operator})

    def waves_by(self, name: GeomKey, operator: str) -> TargetWaves:
        """Copy the waves of a surface to a solver with another wave operator.

        The copy has the present height and velocity. No contact reaches it; the surface itself
        stays as it is. Raises `SolverError` for an unknown operator.
        """
        surface = self._surface(name)
        waves = surface.waves
        copy = waves.on(waves.rest, waves.material, **{**surface.options, "operator": operator})
        copy.state = waves.state
        return copy

    def to_geom(self, name: GeomKey, point: ArrayLike) -> NDArray[np.float64]:
        """Carry a point [m] from the frame of a geom's body to the frame of the geom.

        MuJoCo chooses the frame of a mesh geom. Points of `poke` and `make_rigid` are in the body's
        frame; points of an atlas, and of the waves `ripples[name]`, are in the geom's frame.
        """
        target = self._surface(name).id
        if not is_geom(target, self.model):  # a flex or a skin is in the world
            return np.array(point, dtype=np.float64)
        places = check_points(point) - self.model.geom_pos[target]
        return (places @ rotation_in_body(self.model, target)).reshape(np.shape(point))

    @property
    def sensors(self) -> dict[str, Sensor]:
        """The sensors that `add_sensor` has added to the model, by name.

        They tell points, kind, rate, bandwidth and latency. Their samples are in `data.sensordata`,
        and each step takes them out of here.
        """
        return dict(self._sensor_data.sensors)

    @property
    def last_impulses(self) -> list[Impulse]:
        """The impulses that the surfaces received in the latest `step`, `mj_step` or `following`.

        There is one record for each pair of geoms and each physics step. A geom that is wedged
        between parts of the surface has one for each place where it touches.
        """
        return self._loads.impulses

    def step(self, data: mujoco.MjData) -> None:
        """Apply the contact forces of the latest physics step, and advance the waves.

        The waves advance to `data.time`. The samples of sensors that `add_sensor` has added to the
        model are then in `data.sensordata`.

        After `mj_step` the forces and poses in `data` are those at the beginning of the step.
        MuJoCo holds the forces over the step, so each contact gives normal force times time step.
        Of several steps since the last call only the latest gives its impulses, and a warning says
        so; see `mj_step`. If time stands still, nothing happens.

        If the simulation was reset (`mj_resetData`, a keyframe, MuJoCo's automatic reset of a
        simulation that diverges, or a time that went back), the waves are reset too, and of the
        steps since then only the latest counts, as at the first call.

        Raises
        ------
        SceneError
            If `data` belongs to another model.
        """
        self._loads.skip()
        self._follow(own_data(self.model, data))

    @checked(SceneError, nstep=whole(0))
    def mj_step(self, data: mujoco.MjData, nstep: int = 1) -> None:
        """Take physics steps as `mujoco.mj_step` does, and `step` after each of them.

        Parameters
        ----------
        data : mujoco.MjData
        nstep : int
            How many.

        Raises
        ------
        SceneError
            If `data` belongs to another model.
        SimulationError
            If MuJoCo cannot continue, for instance for lack of memory for contacts.
        """
        self._loads.skip()
        data = own_data(self.model, data)
        with physics_errors():
            for _ in range(nstep):
                mujoco.mj_step(self.model, data)
                self._follow(data)

    @contextlib.contextmanager
    def following(self, data: mujoco.MjData) -> Iterator[None]:
        """Follow the physics steps that other code takes, such as an environment's `step`.

        This is a context manager. Within it each `mujoco.mj_step` or `mujoco.mj_step2` on this data
        is followed by a `step`, whoever calls it, and however many steps are taken at once.

        Raises
        ------
        SceneError
            If `data` belongs to another model.
        """
        self._loads.skip()
        data = own_data(self.model, data)
        with followed(data, lambda: self._follow(data)):
            yield
        self._follow(data)  # warns of steps that were taken in other ways

    def energy(self, data: mujoco.MjData) -> Energy:
        """Kinetic and potential energy of the bodies, energy of the waves, and their total [J].

        With `two_way` contacts do not raise the total, within the bounds given in how-it-works.md;
        actuators may.

        Raises
        ------
        SceneError
            If `data` belongs to another model.
        """
        bodies = body_energy(own_data(self.model, data), self._scratch)
        wave_energy = sum(waves.energy() for waves in self._waves.values())
        return Energy(bodies, wave_energy)

    def vertices(self, name: GeomKey, data: mujoco.MjData) -> NDArray[np.float64] | None:
        """Where the vertices of a target's mesh are [m], [n, 3].

        Vertices of a flex or a skin are in the world, by `data`. Vertices of a geom are in its own
        frame, if `ripples[name].move` has moved them; otherwise the result is None.
        """
        surface = self._surface(name)
        soft = self._soft.get(surface.id)
        return surface.waves.vertices if soft is None else soft.vertices(data)

    def surface(self, name: GeomKey, data: mujoco.MjData | None = None) -> Surface:
        """The surface of a target in the world, displaced by its waves.

        The triangles are those of the target's mesh, the same at all times. Each vertex is moved
        along its normal by the height there, in full: frames show less of heights that are too
        large for the object, see `DisplacementLimit`. Waves that are shorter than the edges of the
        mesh are not to be seen in it; a .ply or .glb file of `Exporter` has triangles as fine as
        the texels.

        Parameters
        ----------
        name : str or int
            Geom.
        data : mujoco.MjData, optional
            By default that of the latest `step`, as it is now; see `TargetWaves.to_world`.

        Returns
        -------
        Surface
            `V, F, normals = ripples.surface(name)`: vertices [m] float64 [n, 3], triangles int64
            [m, 3], and unit normals float64 [n, 3].

        Raises
        ------
        SceneError
            For an unknown geom, or if `data` belongs to another model.
        """
        state = self._whereabouts.data(data)
        return self._surface(name).waves.surface(state, self.vertices(name, state))

    def reset(self) -> None:
        """Flatten all surfaces, and restart time."""
        self._clock.restart()
        self._flatten()

    def allow_any_height(self, name: GeomKey) -> None:
        """Give no warning of waves on a geom that are too high or too steep for it."""
        target = self._surface(name).id
        if is_geom(target, self.model):  # flexes and skins are not watched
            self._check_amplitude.ignore(target)

    def _follow(self, data: mujoco.MjData) -> None:
        """Advance the waves by the physics steps since the last call; flatten them at a reset."""
        self._whereabouts.follow(data)
        passed = self._clock.look(self.model, data)
        # whether MuJoCo's automatic reset is disabled, and the state has diverged since the last
        # reset
        broken = bool(self.model.opt.disableflags & NO_RESET) and divergence(data) is not None
        if passed.reset or broken:
            self._flatten()
            self._warn_once("divergence", divergence_warning(self.model, data))
        self._warn_once("missed", missed_warning(passed.missed))
        self._warn_once("in turn", IN_TURN_WARNING if passed.in_turn else None)
        self._warn_once("disabled", disabled_warning(self.model))
        if broken or not passed.elapsed:
            return
        self.follow_shapes()
        solved, warning = self._solved.find(data)
        self._warn_once("unsolved", warning)
        self._check_tunnelling(solved)
        for target, surface in self._soft.items():
            self._waves[target].move(surface.vertices(solved))
        self._step_waves(data, solved, passed.elapsed, pending=warning is not None)
        self._sensor_data.write(data)
        self._warn_once("sensors", self._sensor_data.timestep_warning())
        self._check_amplitude()

    def _step_waves(
        self, data: mujoco.MjData, solved: mujoco.MjData, elapsed: float, *, pending: bool
    ) -> None:
        """Advance the waves under the contact forces of the latest physics step.

        Parameters
        ----------
        data : mujoco.MjData
            The user's; two-way coupling corrects it.
        solved : mujoco.MjData
            With the contact forces, see `SolvedForces`.
        elapsed : float
            [s]
        pending : bool
            Whether the forces are those of the coming step.
        """
        shared = None
        if self._two_way is not None:
            shared = self._two_way.solve(data, solved, elapsed, pending=pending)
        loads = self._loads.loads(solved, elapsed)
        for target, easing in self._eased.items():
            name = target_name(self.model, target)
            self._warn_once(f"eased {target}", easing_warning(name, easing))
        for target, filtered in self._high_pass.items():
            unfiltered = loads[target]
            if isinstance(unfiltered, Load):  # always: hits on flexes and skins have no pulses
                loads[target] = filtered(unfiltered)
        for target, waves in self._waves.items():
            step_load = loads[target] if shared is None else shared.get(target)
            waves.step(elapsed, load=step_load)
            if isinstance(step_load, Load) and len(step_load.texels):
                self._check_amplitude.note_load(target, step_load.texels)
        if self._two_way is not None:
            self._two_way.settle()

    def _take_up_all(self, target: TargetId) -> None:
        """Take up all forces on a target from now on: the user gives its density."""
        self._easings.pop(target, None)
        if self._eased.pop(target, None) is not None:
            self._loads.take_up_all(target)

    def follow_shapes(self) -> None:
        """Lay new atlases on targets whose surfaces were changed in the model.

        A surface changes with its geom's size, the data of its height field or the vertices of its
        mesh. The waves on a new atlas begin flat. Each step does this by itself.

        Raises
        ------
        SceneError
            If a region of such a target is held still, its material is given texel by texel, or
            sensors listen to it.
        MeshError
            If the new surface does not suit the layout.
        """
        changed = self._follow_shapes()
        if changed:
            self._couple(self._check_amplitude)
            names = ", ".join(map(repr, changed))
            self._warn_once(
                f"shapes {names}",
                f"the surface of {names} was changed in the model: it gets a new atlas, and its "
                "waves begin flat; set surfaces before Ripples is made where that takes too long",
            )

    def _couple(self, old_check: AmplitudeCheck | None) -> CoupledModel:
        """Have the model's contacts drive the present waves, with new records of all contacts.

        There is no second warning of a target that the old check no longer watches.
        """
        coupled = CoupledModel(self.model, self._waves, self._contacts)
        rigid = {geom: self._waves[geom] for geom in self._rigid_targets()}
        self._soft = coupled.soft
        self._high_pass = {
            target: HighPass(self._waves[target], surface)
            for target, surface in coupled.soft.items()
            if surface.flex >= 0 and self._has_high_pass[target_name(self.model, target)]
        }
        hits = {target: Hits(coupled, target, modulus) for target, modulus in self._moduli.items()}
        bodies = bodies_of(coupled)
        self._eased = {
            target: Easing(law, bodies, self._waves[target].rest)
            for target, law in self._easings.items()
        }
        self._loads = ContactLoads(coupled, self._waves, hits, self._eased)
        self._check_amplitude = AmplitudeCheck(coupled, rigid, self._eased)
        for geom in rigid:
            if old_check is not None and not old_check.watches(geom):
                self._check_amplitude.ignore(geom)
        can_push = self._has_two_way and not (self._moduli or coupled.soft)
        self._two_way = TwoWay(coupled, self._waves) if can_push else None
        return coupled

    def _rigid_targets(self) -> list[GeomId]:
        """The targets that are geoms."""
        return [target for target in self._waves if is_geom(target, self.model)]

    def _surface(self, name: GeomKey) -> RipplingSurface:
        """The surface of a target; raises `SceneError` if it does not ripple."""
        surface = self._surfaces.get(name) if isinstance(name, str) else None
        if surface is None:
            surface = self._surfaces.get(target_name(self.model, find_any(self.model, name)))
        if surface is None:
            raise SceneError(
                f"geom {name!r} does not ripple; the rippling geoms are "
                f"{', '.join(map(repr, self._surfaces))}"
            )
        return surface

    def _follow_shapes(self) -> list[str]:
        """Lay new atlases on targets whose surfaces were changed; return their names."""
        changed = [
            name
            for name, surface in self._surfaces.items()
            if surface.shape is not None and surface.shape.changed(self.model)
        ]
        for name in changed:
            surface = self._surfaces[name].on_its_surface(self.model)
            self._surfaces[name] = surface
            self._waves[surface.id] = surface.waves
        return changed

    def _change(self, name: GeomKey, **changes: Any) -> None:
        """Change a surface's material, options or held region.

        If that fails, nothing has changed.
        """
        surface = self._surface(name).rebuilt(**changes)
        target = surface.id
        self._surfaces[target_name(self.model, target)] = surface
        self._waves[target] = surface.waves
        self._loads.waves_changed(target)
        if is_geom(target, self.model):
            self._check_amplitude.waves_changed(target, surface.waves)
        if target in self._high_pass:
            self._high_pass[target] = HighPass(surface.waves, self._soft[target])

    def _flatten(self) -> None:
        """Flatten all surfaces, and forget all contacts and samples."""
        self._check_amplitude.flush()
        self._loads.clear()
        if self._two_way is not None:
            self._two_way.clear()
        for waves in self._waves.values():
            waves.reset()
        self._sensor_data.clear(self._whereabouts.latest)

    def _warn_once(self, kind: str, message: str | None) -> None:
        """Give a warning, if there is one and none of its kind was given before."""
        if message is not None and kind not in self._warned:
            self._warned.add(kind)
            warn_caller(message)
