"""`Simulation`: physics and waves of a scene, frame by frame."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any, Self

import mujoco

from ripple_sim.coupling.energy import Energy
from ripple_sim.coupling.geoms import find_target, target_name
from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.coupling.stepping import divergence, physics_errors
from ripple_sim.coupling.target import Target
from ripple_sim.errors import SceneError, SimulationError
from ripple_sim.scene.events import Script
from ripple_sim.scene.scene import Scene
from ripple_sim.scene.scene_file import RippleEntry, SensorEntry, apply_maps, uniform_material
from ripple_sim.scene.target_maps import rim_of
from ripple_sim.solver.compile_clock import work_clock
from ripple_sim.solver.errors import FUNCTION, POSITIVE, checked, instance
from ripple_sim.solver.waves.sensor import Sensor

# Highest number of physics steps in a frame: more are a mistake in a unit, and would seem to hang.
_MAX_STEPS_PER_FRAME = 100_000


class Simulation:
    """A running scene: MuJoCo's state and the ripples on its targets, advanced frame by frame.

    The model's time step is shortened a little if needed, so that a frame is a whole number of
    steps.

    Parameters
    ----------
    scene : Scene
    fps : float
        Frames per second of simulated time.
    resolution : int, optional
        Overrides the scene's atlas resolutions.
    layout : str, optional
        Overrides the scene's layouts.
    rim : str, optional
        Overrides what the scene's rims do, see `WaveSolver`.
    backend : str
        As for `WaveSolver`.
    operator : str
        Likewise.
    on_step : callable, optional
        Called with the simulation before each physics step: to steer actuators, move mocap bodies,
        press on surfaces.

    Attributes
    ----------
    scene : Scene
    model : mujoco.MjModel
        A copy of the scene's, with its own time step.
    data : mujoco.MjData
    ripples : Ripples
        The waves on the scene's targets.
    steps_per_frame : int
        Physics steps in a frame.
    limited : dict of str to bool
        Whether heights are limited where they are drawn, by geom.
    impulses : list of Impulse
        Of the present frame, so far.
    sensors : dict of str to Sensor
        Those of the scene, by name.
    """

    impulses: list[Impulse]
    _steps: int  # physics steps that the next frame has already taken

    @checked(
        SceneError,
        scene=instance(Scene, ", from load_scene or drop_scene"),
        fps=POSITIVE,
        on_step=FUNCTION,
    )
    def __init__(
        self,
        scene: Scene,
        *,
        fps: float = 60,
        resolution: int | None = None,
        layout: str | None = None,
        rim: str | None = None,
        backend: str = "auto",
        operator: str = "fem",
        on_step: Callable[[Simulation], None] | None = None,
    ) -> None:
        self.scene = scene
        self._on_step = on_step
        self.model = copy.copy(scene.model)
        self._divide_frames(fps)
        self.data = mujoco.MjData(self.model)
        targets = {
            entry.geom: self._target(entry, resolution, layout, rim) for entry in scene.targets
        }
        self.ripples = Ripples(
            self.model, targets, backend=backend, operator=operator, two_way=scene.two_way
        )
        self.limited = {}
        for entry in scene.targets:
            apply_maps(self.ripples, entry)
            name = target_name(self.model, find_target(self.model, entry.geom))
            self.limited[name] = entry.limit
        self._heights_at_start = {}  # by geom [m]
        for entry in scene.targets:
            if entry.height is not None:
                self._heights_at_start[entry.geom] = entry.height.heights(self.ripples, entry.geom)
        # by geom
        self._materials_at_start = {name: self.ripples[name].material for name in self.ripples}
        # times spent so far [s]
        self.physics_seconds = 0.0
        self.wave_seconds = 0.0
        self.reset()
        self.sensors = {entry.name: self._sensor(entry) for entry in scene.sensors}

    def _divide_frames(self, fps: float) -> None:
        """Shorten the model's time step, so that a frame is a whole number of equal steps."""
        timestep = self.model.opt.timestep
        steps = 1 / (fps * timestep)
        if not steps < _MAX_STEPS_PER_FRAME:
            raise SceneError(
                f"the model's timestep must give at most {_MAX_STEPS_PER_FRAME} steps per "
                f"frame, got {timestep:g} s, which are {steps:.3g}: use a longer timestep in "
                "the MJCF's <option>"
            )
        self.steps_per_frame = max(1, math.ceil(steps - 1e-9))
        self.model.opt.timestep = 1 / (fps * self.steps_per_frame)

    def _sensor(self, entry: SensorEntry) -> Sensor:
        """Have a sensor of the scene listen to its surface."""
        if entry.site is not None:
            place: Any = entry.site
        else:
            points = [entry.point] if entry.point is not None else entry.points
            place = self.ripples.to_geom(entry.geom, points)
        waves = self.ripples[entry.geom]
        return waves.sensor(place, entry.kind, entry.rate, thickness=entry.thickness)

    def _target(
        self, entry: RippleEntry, resolution: int | None, layout: str | None, rim: str | None
    ) -> Target:
        """The target of an entry of the scene, with the overrides of the simulation."""
        return Target(
            uniform_material(entry),
            resolution=resolution or entry.resolution,
            layout=layout or entry.layout,
            rim=rim or rim_of(self.model, entry.geom, entry.rim),
            high_pass=entry.high_pass,
            pulse=entry.pulse,
            modulus=entry.modulus,
            contacts=entry.contacts,
            limit=entry.limit and entry.warn,
            conserve_volume=entry.conserve_volume,
        )

    @classmethod
    def of(
        cls,
        scene: Scene,
        options: Any,
        *,
        operator: str = "fem",
        on_step: Callable[[Simulation], None] | None = None,
    ) -> Self:
        """Simulation of a scene with the options of a video or an export.

        `options` has the attributes rate, resolution, layout, rim and backend.
        """
        return cls(
            scene,
            fps=options.rate,
            resolution=options.resolution,
            layout=options.layout,
            rim=options.rim,
            backend=options.backend,
            operator=operator,
            on_step=on_step,
        )

    @property
    def backend(self) -> str:
        """Backend of the wave solvers."""
        return self.ripples[self.scene.targets[0].geom].backend

    @property
    def substeps_taken(self) -> int:
        """Wave steps so far, on all targets."""
        return sum(self.ripples[name].substeps_taken for name in self.ripples)

    @property
    def energy(self) -> Energy:
        """Energy of bodies, of waves, and of both [J]; see `Ripples.energy`."""
        return self.ripples.energy(self.data)

    def advance_frame(self) -> None:
        """Advance physics and waves to the next frame.

        `impulses` then holds all impulses since the last frame.

        Raises
        ------
        SimulationError
            If MuJoCo's state is no longer finite.
        """
        for _ in range(self.steps_per_frame - self._steps):
            self.step()
        self._steps = 0

    def step(self) -> None:
        """Advance physics and waves by one physics step.

        `advance_frame` then does the rest of the frame.

        Raises
        ------
        SimulationError
            If MuJoCo's state is no longer finite.
        """
        if self._steps == 0:
            self.impulses = []
        self._steps += 1
        start = work_clock()
        if self._on_step is not None:
            self._on_step(self)
        self._script.apply(self.data, self.ripples)
        with physics_errors():
            mujoco.mj_step(self.model, self.data)
        physics_end = work_clock()
        broken = divergence(self.data)
        if broken is not None:
            raise SimulationError(
                f"the physics became unstable at {self.data.time:.4g} s ({broken}); use a shorter "
                "time step in the MJCF's <option>, or softer contacts"
            )
        self.ripples.step(self.data)
        self.impulses += self.ripples.last_impulses
        self.physics_seconds += physics_end - start
        self.wave_seconds += work_clock() - physics_end

    def reset(self) -> None:
        """Return to the beginning: bodies, waves, materials and script."""
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        else:
            mujoco.mj_resetData(self.model, self.data)
        with physics_errors():
            mujoco.mj_forward(self.model, self.data)
        self.ripples.reset()
        for name, material in self._materials_at_start.items():
            if self.ripples[name].material is not material:
                self.ripples.change_material(name, **vars(material))
                self._materials_at_start[name] = self.ripples[name].material
        for geom, height in self._heights_at_start.items():
            self.ripples[geom].add_height(height)
        self._script = Script(self.model, self.scene.events, list(self.ripples))
        self.impulses = []
        self._steps = 0
