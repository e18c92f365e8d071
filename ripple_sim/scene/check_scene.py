"""A scene's names and numbers against its model, before anything is simulated."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from ripple_sim.coupling.arguments import own_model
from ripple_sim.coupling.collision_geoms import named_collision_geoms
from ripple_sim.coupling.geoms import find_target
from ripple_sim.errors import SceneError
from ripple_sim.solver.layouts.build import LAYOUTS

from .camera import check_camera
from .events import Script
from .overlays import parse_request
from .scene import MAX_DURATION, Scene
from .scene_file import RippleEntry


def check_scene(scene: Scene) -> None:
    """Check a scene's names and numbers against its model.

    Raises
    ------
    SceneError
    SolverError
        For an invalid material.
    """
    from ripple_sim.render import LIGHTING  # brings OpenGL, which reading a scene file can do without until here

    own_model(scene.model)
    if not scene.targets:
        raise SceneError(f"scene {scene.name!r} has no [[ripple]] entry; name at least one geom")
    if not 0 < scene.duration < MAX_DURATION:
        raise SceneError(f"duration is {scene.duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    seen = set()
    for entry in scene.targets:
        if entry.geom in seen:
            raise SceneError(f"geom {entry.geom!r} has two [[ripple]] entries; valid is one")
        seen.add(entry.geom)
        _check_target(scene.model, entry)
    named_collision_geoms(scene.model, [entry.geom for entry in scene.targets], scene.contacts)
    parse_request(scene.overlay)
    if scene.lighting not in LIGHTING:
        raise SceneError(f"lighting is {scene.lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
    Script(scene.model, scene.events, [entry.geom for entry in scene.targets])
    check_camera(scene.model, scene.camera)


def _check_target(model: mujoco.MjModel, entry: RippleEntry) -> None:
    from ripple_sim.render import LOOKS
    from ripple_sim.solver.operator.assembly import RIMS

    find_target(model, entry.geom)
    for what, name, valid in (("look", entry.look, LOOKS), ("layout", entry.layout, LAYOUTS), ("rim", entry.rim, RIMS)):
        if name not in valid:
            raise SceneError(f"{what} {name!r} does not exist; valid are {', '.join(valid)}")
    if entry.color is not None and not all(0 <= part <= 1 for part in entry.color):
        raise SceneError(f"color of geom {entry.geom!r} is {entry.color}; valid are three numbers from 0 to 1 (sRGB)")
    entry.material.material(np.ones((1, 1, 1)) if entry.inside else None)
    for body in entry.inside:
        body.check()
    if entry.height is not None:
        entry.height.check()
    least, greatest = entry.thickness_limits
    if not 0 <= least <= greatest:
        raise SceneError(
            f"thickness_limits of geom {entry.geom!r} are {entry.thickness_limits} m; valid are two numbers from 0 on, "
            "the least first"
        )
    for coefficient, each in entry.material.maps().items():
        _check_image(
            f"ripple.material.{coefficient}", each.map, "a number, or the path of an image relative to the scene file"
        )
    if entry.still_map is not None:
        _check_image("ripple.still_map", entry.still_map, "the path of an image relative to the scene file")
    for disc in entry.still:
        if not 0 < disc.radius < float("inf"):
            raise SceneError(
                f"a [[ripple.still]] disc of geom {entry.geom!r} has radius {disc.radius!r} m; valid is above 0"
            )


def _check_image(key: str, path: str, valid: str) -> None:
    if not Path(path).is_file():
        raise SceneError(f"{key} names the image {path!r}, which does not exist; valid is {valid}")
