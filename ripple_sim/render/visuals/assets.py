"""What all visuals of a model share on the GPU."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ripple_sim.render.resources import Resources

from .materials import Textures
from .object_table import ObjectTable


@dataclass(frozen=True)
class Assets:
    """A model, its textures on the GPU, and the table of objects, in which every visual has a row."""

    model: Any
    resources: Resources
    textures: Textures
    objects: ObjectTable

    @classmethod
    def of(cls, model: Any, resources: Resources) -> Assets:
        """Assets of a model (mujoco.MjModel)."""
        return cls(model, resources, Textures(resources, model), ObjectTable(resources))
