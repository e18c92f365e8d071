"""`TargetWaves`: the waves of a target, and the transform between its frame and the world."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver import Atlas, Material, WaveSolver
from ripple_sim.solver.cache import kept_with
from ripple_sim.solver.mesh import vertex_normals
from ripple_sim.solver.mesh.points import check_points

from .ids import TargetId
from .own_model import own_data, posed
from .soft import target_pose


class Surface(NamedTuple):
    """The surface of a target in the world, displaced by its waves.

    Attributes
    ----------
    V : float64 [n, 3]
        Vertices [m].
    F : int64 [m, 3]
        Triangles, counter-clockwise from outside.
    normals : float64 [n, 3]
        Outward unit normals of the displaced surface at the vertices.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    normals: NDArray[np.float64]


class Whereabouts:
    """Where the targets of a model are in the world: by the latest data, or as the model begins."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._data: mujoco.MjData | None = None

    @property
    def latest(self) -> mujoco.MjData | None:
        """The latest data; None before the first step."""
        return self._data

    def follow(self, data: mujoco.MjData) -> None:
        """Take a simulation's data as the latest."""
        self._data = data

    def data(self, data: mujoco.MjData | None = None) -> mujoco.MjData:
        """The data that are given, with poses; by default the latest data.

        Raises `SceneError` if `data` belongs to another model.
        """
        if data is None:
            data = self._data if self._data is not None else mujoco.MjData(self._model)
        return posed(self._model, own_data(self._model, data, drawn=True))


class TargetWaves(WaveSolver):
    """Waves of a target of `Ripples`: a `WaveSolver` that knows where its surface is in the world.

    `atlas.positions`, `atlas.mesh.V` and the points of `add_impulse` are in the frame of the
    target. This is the frame of the geom, which for a mesh is not that of its file: MuJoCo puts the
    frame of a mesh at its centre of mass and along its principal axes of inertia. The frame of a
    flex or a skin is the world.
    """

    def __init__(
        self,
        whereabouts: Whereabouts,
        target: TargetId,
        atlas: Atlas,
        material: Material,
        **options: Any,
    ) -> None:
        super().__init__(atlas, material, **options)
        self._whereabouts = whereabouts
        self._target = target

    def on(self, atlas: Atlas, material: Material, **options: Any) -> TargetWaves:
        """New waves of the same target, with the keyword arguments of `WaveSolver`."""
        return TargetWaves(self._whereabouts, self._target, atlas, material, **options)

    def to_world(self, points: ArrayLike, data: mujoco.MjData | None = None) -> NDArray[np.float64]:
        """Carry points [m] from the frame of the target to the world.

        Parameters
        ----------
        points : [..., 3]
            For instance `atlas.positions`.
        data : mujoco.MjData, optional
            By default that of the latest `Ripples.step`, as it is now. Before the first step the
            target is where the model's `qpos0` has it. After `mj_step`, and until `mj_forward`,
            the poses in `data` are those at the beginning of the step, as are the points of
            `Ripples.last_impulses`.

        Returns
        -------
        float64 [..., 3]
            [m].

        Raises
        ------
        AtlasError
            If the points are not finite, or not three numbers each.
        SceneError
            If `data` belongs to another model.
        """
        position, rotation = target_pose(self._whereabouts.data(data), self._target)
        return _checked(points) @ rotation.T + position

    def from_world(
        self, points: ArrayLike, data: mujoco.MjData | None = None
    ) -> NDArray[np.float64]:
        """Carry points [m], [..., 3], from the world to the frame of the target: the way back."""
        position, rotation = target_pose(self._whereabouts.data(data), self._target)
        return (_checked(points) - position) @ rotation

    def surface(
        self, data: mujoco.MjData | None = None, vertices: NDArray[np.float64] | None = None
    ) -> Surface:
        """The surface in the world, displaced; see `Ripples.surface`.

        `vertices` [n, 3] [m] are those of the mesh in the frame of the target, if they have moved.
        """
        mesh = self.rest.mesh
        V = mesh.V if vertices is None else vertices
        F = np.asarray(mesh.F, np.int64)
        normals = mesh.vertex_normals if vertices is None else vertex_normals(V, F)
        heights = _heights_at_vertices(self.rest) @ self.height.reshape(-1)
        displaced = V + heights[:, None] * normals
        position, rotation = target_pose(self._whereabouts.data(data), self._target)
        return Surface(
            V=displaced @ rotation.T + position,
            F=F,
            normals=vertex_normals(displaced, F) @ rotation.T,
        )

    def __getstate__(self) -> tuple[Any, ...]:
        return (*super().__getstate__(), self._whereabouts, self._target)

    def __setstate__(self, pickled: tuple[Any, ...]) -> None:
        *waves, self._whereabouts, self._target = pickled
        super().__setstate__(tuple(waves))


def _checked(points: ArrayLike) -> NDArray[np.float64]:
    """Points [..., 3] as float64 of the same shape; raises `AtlasError` if they are not valid."""
    shape = np.shape(points)
    flat = np.reshape(points, (-1, 3)) if len(shape) > 2 and shape[-1] == 3 else points
    return check_points(flat).reshape(shape)


@kept_with
def _heights_at_vertices(atlas: Atlas) -> Any:
    """SciPy CSR matrix [n, T] from a flattened field to its values at the vertices of the mesh."""
    return atlas.sampling_matrix(atlas.mesh.V)
