"""One scene of a batch: its seed, its values, and the scene that they make."""

from __future__ import annotations

import dataclasses
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.scene.check_scene import check_scene
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.events import Events
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.scene.scene_file import parse_scene

from .distributions import Distribution
from .plan import MeshesEntry, Plan
from .vary_model import vary_model
from .vary_table import vary_table

_SEED_BITS = 29  # so that `ripple-sim render --seed` takes it: nine digits

_EVENTS = tuple(field.name for field in dataclasses.fields(Events))


class Varied(NamedTuple):
    """A scene, and the values drawn for it by their keys."""

    scene: Scene
    values: dict[str, Any]


class Variation:
    """The scene of a number, which is the same whoever makes it, and in whatever order.

    Each key has a stream of random numbers of its own, so a key more in the plan leaves the values of the others.

    Attributes
    ----------
    seed : int
        Of the scene: for its `[random]`, or for the bodies that drop on a mesh.
    """

    def __init__(self, plan: Plan, number: int) -> None:
        self.plan, self.number = plan, number
        self.source = plan.sources[number % len(plan.sources)]
        drawn = np.random.SeedSequence(plan.seed, spawn_key=(number,)).generate_state(1)[0]
        self.seed = int(drawn) >> (32 - _SEED_BITS)

    def stream(self, key: str) -> np.random.Generator:
        """The random numbers of a key."""
        spawned = np.random.SeedSequence(self.plan.seed, spawn_key=(self.number, zlib.crc32(key.encode())))
        return np.random.Generator(np.random.PCG64(spawned))

    def load(self) -> Varied:
        """Load the scene with its values.

        Raises
        ------
        RippleError
            If a key of the plan fits nothing, or the scene refuses a value.
        """
        values: dict[str, Any] = {}

        def edit(spec: mujoco.MjSpec) -> None:
            values.update(vary_model(spec, self.plan.model, self.stream))

        def change(table: dict[str, Any]) -> None:
            if "random" in table:
                table["random"]["seed"] = self.seed
            values.update(vary_table(table, self.plan.vary, self.stream))

        if Path(self.source).suffix in ("", ".toml"):
            scene = load_scene(self.source, edit=edit, change=change)
        else:
            bodies = self._bodies()
            values["bodies"] = bodies
            meshes = self.plan.meshes or MeshesEntry([])
            scene = drop_scene(
                self.source,
                bodies=bodies,
                seed=self.seed,
                up=meshes.up,
                look=meshes.look,
                edit=edit,
                repair=meshes.repair,
                wrap=meshes.wrap,
            )
            table = _table(scene)
            change(table)
            scene = _scene(scene, table)
        return Varied(scene, dict(sorted(values.items())))

    def _bodies(self) -> int:
        bodies = self.plan.meshes.bodies if self.plan.meshes else 0
        if not isinstance(bodies, Distribution):
            return bodies
        drawn = bodies.draw(self.stream("bodies"))
        if not isinstance(drawn, int):
            raise SceneError(f"plan: the number of bodies is {drawn!r}; draw it from integers")
        return drawn


def _table(scene: Scene) -> dict[str, Any]:
    """What a scene file would say of a scene that was made without one."""
    parts = {"ripple": list(scene.targets), "camera": scene.camera}
    parts |= {name: list(getattr(scene.events, name)) for name in _EVENTS}
    table = {name: _given(part) for name, part in parts.items() if part}
    return {"model": scene.name, "duration": scene.duration, "two_way": scene.two_way} | table


def _given(entry: Any) -> Any:
    """The fields of an entry that are not as by default, as plain values."""
    if isinstance(entry, list):
        return [_given(each) for each in entry]
    if not isinstance(entry, msgspec.Struct):
        return msgspec.to_builtins(entry)
    fields = msgspec.structs.fields(entry)
    given = {field.name: getattr(entry, field.name) for field in fields}
    defaults = {field.name: field.default for field in fields}
    return {
        name: _given(value)
        for name, value in given.items()
        if value is not None and value != [] and value != defaults[name]
    }


def _scene(scene: Scene, table: dict[str, Any]) -> Scene:
    """The scene with what a table says."""
    content = parse_scene(table, scene.name)
    varied = dataclasses.replace(
        scene,
        targets=tuple(content.ripple),
        camera=content.camera,
        duration=content.duration,
        events=Events(**{name: tuple(getattr(content, name)) for name in _EVENTS}),
        two_way=content.two_way,
        overlay=tuple(content.overlay),
        lighting=content.lighting,
    )
    check_scene(varied)
    return varied
