"""Which rippling surface lies under a ray."""

from __future__ import annotations

import dataclasses

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.soft_ids import target_pose
from ripple_sim.simulation import Simulation


@dataclasses.dataclass(frozen=True, eq=False)
class Hit:
    """Where a ray meets a rippling surface.

    Attributes
    ----------
    geom : str
    point : float64 [3]
        In the frame of the geom [m].
    distance : float
        From the ray's origin, in lengths of its direction.
    """

    geom: str
    point: NDArray[np.float64]
    distance: float


class Picker:
    """Casts rays at the undisplaced targets of a simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._scenes: dict[str, tuple[NDArray[np.float64] | None, EmbreeScene]] = {
            name: (None, _ray_scene(simulation, name)) for name in simulation.ripples
        }

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> Hit | None:
        """Nearest point of a target on a ray from a point [m] of the world, or None."""
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        hits = []
        for name in self._scenes:
            scene = self._scene(name)
            position, rotation = self._pose(name)
            local, heading = (start - position) @ rotation, along @ rotation
            found = scene.run(local[None].astype(np.float32), heading[None].astype(np.float32), output=1)
            if found["primID"][0] >= 0:
                distance = float(found["tfar"][0])
                hits.append(Hit(name, local + distance * heading, distance))
        return min(hits, key=lambda hit: hit.distance, default=None)

    def reach(self, origin: ArrayLike, direction: ArrayLike) -> float:
        """How far along a ray a target is met, or passed most closely by its first one's middle, in its lengths."""
        start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        hit = self.pick(start, along)
        if hit is not None:
            return hit.distance
        middle, _ = self._pose(self._simulation.scene.targets[0].geom)
        return max(float((middle - start) @ along / (along @ along)), 0.0)

    def _scene(self, name: str) -> EmbreeScene:
        """A target's surface where it is."""
        V, scene = self._scenes[name]
        if self._simulation.ripples[name].vertices is not V:
            scene = _ray_scene(self._simulation, name)
            self._scenes[name] = self._simulation.ripples[name].vertices, scene
        return scene

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position [m] and rotation matrix of a geom in the world."""
        return target_pose(self._simulation.data, self._simulation.ripples.geom_ids[name])


def _ray_scene(simulation: Simulation, name: str) -> EmbreeScene:
    mesh = simulation.ripples[name].atlas.mesh
    scene = EmbreeScene()
    TriangleMesh(scene, mesh.V.astype(np.float32), mesh.F.astype(np.int32))
    return scene
