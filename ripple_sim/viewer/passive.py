"""`launch_passive`: MuJoCo's own viewer, with the ripples on the surfaces."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId, flex_of, is_geom, skin_of
from ripple_sim.coupling.own_model import own_data, own_model
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.coupling.soft import target_pose
from ripple_sim.errors import DisplayError, SceneError
from ripple_sim.render.visuals.corners import normalized, smooth_normals
from ripple_sim.solver import WaveSolver

from .opening import SWINGING, display_problem

# Triangles of all targets together: MuJoCo takes them one by one, a thousand in 2 ms.
_MAX_TRIANGLES = 5000

# Opacity of the still surface: it cannot be seen, but the mouse finds it.
_HIDDEN_OPACITY = 1e-3

# Scale of the still surface, so that troughs do not lie in its shadow.
_HIDDEN_SCALE = 0.8

# Radius on which the mouse presses, over the size of the target.
_FINGER_RADIUS = 0.05

# MuJoCo's colour of a geom without a colour of its own
_DEFAULT_COLOR = (0.5, 0.5, 0.5, 1.0)

# [s]: how long `close` waits for the window
_CLOSING_TIME = 5.0


def launch_passive(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ripples: Ripples,
    *,
    key_callback: Callable[[int], None] | None = None,
    show_left_ui: bool = True,
    show_right_ui: bool = True,
) -> RippleViewer:
    """Open MuJoCo's viewer beside your own loop, and show the ripples.

    It is used like `mujoco.viewer.launch_passive`.

    Nothing has to be prepared in the model: targets are drawn as some thousand triangles of their
    colour, without textures, in place of their still surfaces. Where the mouse pulls at a target's
    body (a double click, then control, right button and drag), the surface follows it; bodies that
    can move are pulled along, as ever. Geoms of the world body cannot be selected in MuJoCo's
    viewer.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    ripples : Ripples
        Made for this model.
    key_callback : callable, optional
        Called with the code of each key.
    show_left_ui, show_right_ui : bool
        Whether MuJoCo's panels are there.

    Returns
    -------
    RippleViewer

    Raises
    ------
    DisplayError
        If there is no display.
    SceneError
        If the ripples or the data belong to another model.
    """
    model = own_model(model)
    if not isinstance(ripples, Ripples) or ripples.model is not model:
        raise SceneError(
            f"the viewer shows ripples of the model that it is given, not {ripples!r}: "
            "Ripples(model, ...)"
        )
    data = own_data(model, data)
    problem = display_problem()
    if problem:
        raise DisplayError(
            f"no window can be opened: {problem}; RippleRenderer renders frames without one"
        )
    import mujoco.viewer  # opens GLFW

    before = set(threading.enumerate())
    handle = mujoco.viewer.launch_passive(
        model,
        data,
        key_callback=key_callback,
        show_left_ui=show_left_ui,
        show_right_ui=show_right_ui,
    )
    return RippleViewer(handle, data, ripples, set(threading.enumerate()) - before)


class RippleViewer:
    """MuJoCo's passive viewer with ripples. `launch_passive` makes it.

    All of MuJoCo's handle is here: `is_running`, `lock`, `cam`, `opt`, `perturb` (also as `pert`),
    `user_scn`, `set_texts`, `close` and so on. Leaving a `with` block closes it.
    """

    def __init__(
        self, handle: Any, data: mujoco.MjData, ripples: Ripples, threads: set[threading.Thread]
    ) -> None:
        self._handle = handle
        self._threads = threads
        self._data = data
        self._ripples = ripples
        self._time = data.time
        self._skins = {
            name: _Skin(ripples[name], _MAX_TRIANGLES // len(ripples)) for name in ripples
        }
        self.sync()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._handle, name)

    @property
    def pert(self) -> mujoco.MjvPerturb:
        """The selection of the mouse, and the way it pulls."""
        return self._handle.perturb

    def sync(self, state_only: bool = False) -> None:
        """Show the present state and the ripples, and apply the user's input.

        Where the mouse pulls at a target, the surface is pulled too.
        """
        self._press()
        scene = self._handle.user_scn
        model = self._ripples.model
        saved = []  # arrays of the model that are changed for a moment, and their content
        if scene is None or not self.is_running():
            return
        users = scene.ngeom
        try:
            for name, target in self._ripples.geom_ids.items():
                materials, colors = _look(model, target)
                material = materials[0]
                rgba = colors.copy()
                if material >= 0 and tuple(rgba) == _DEFAULT_COLOR:
                    rgba = model.mat_rgba[material]
                triangles = self._skins[name].triangles(self._ripples, name, self._data)
                first = scene.ngeom
                scene.ngeom = min(first + len(triangles[0]), scene.maxgeom)
                for geom, *place in zip(scene.geoms[first : scene.ngeom], *triangles, strict=False):
                    mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_TRIANGLE, *place, rgba)
                    geom.category = mujoco.mjtCatBit.mjCAT_DYNAMIC  # others cast no shadows
                hidden: list[NDArray[Any]] = [colors, materials]
                if is_geom(target, model):
                    hidden.append(model.geom_size[target])
                saved += [(array, array.copy()) for array in hidden]
                # The mouse does not find what has no material and no opacity; with some it casts
                # shadows, but within.
                colors[:] = [*rgba[:3], 0.0 if model.nmat else _HIDDEN_OPACITY]
                if model.nmat:
                    materials[:] = max(material, 0)
                elif len(hidden) == 3:
                    hidden[2][:] *= _HIDDEN_SCALE
            self._handle.sync(state_only)
        finally:
            scene.ngeom = users
            for array, content in saved:
                array[:] = content

    def close(self) -> None:
        """Close the window, and wait until it is closed.

        A program that ends before that may crash in MuJoCo.
        """
        self._handle.close()
        for thread in self._threads - {threading.current_thread()}:
            thread.join(_CLOSING_TIME)

    def _press(self) -> None:
        """Let the surface follow the mouse.

        The force is that of a spring from the surface to the pointer, and acts over the time since
        the last call.
        """
        data = self._data
        pull = self._handle.perturb
        elapsed = data.time - self._time
        self._time = data.time
        if elapsed <= 0 or pull.select <= 0 or not pull.active & mujoco.mjtPertBit.mjPERT_TRANSLATE:
            return
        model = data.model
        body = pull.select
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ pull.localpos
        for name, target in self._ripples.geom_ids.items():
            if not is_geom(target, model) or model.geom_bodyid[target] != body:
                continue
            waves = self._ripples[name]
            position, rotation = target_pose(data, target)
            local = (point - position) @ rotation
            drag = (pull.refselpos - point) @ rotation
            texel = np.linalg.norm(waves.atlas.positions.reshape(-1, 3) - local, axis=1).argmin()
            inwards = -float(drag @ waves.atlas.normals.reshape(-1, 3)[texel])
            radius = _FINGER_RADIUS * float(np.ptp(waves.rest.mesh.V, axis=0).max())
            speed, stiffness, density = (
                float(np.max(getattr(waves.material, name))) for name in SWINGING
            )
            # force that presses the surface in by a metre [N/m], as in `poke_strength`: a mass of
            # pi r^2 sigma / 4 that swings at omega^2 = (2 c / r)^2 + k
            firmness = np.pi * density * (speed**2 + stiffness * radius**2 / 4)
            waves.add_impulse(local, firmness * inwards * elapsed, radius)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _look(model: mujoco.MjModel, target: TargetId) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Materials of a target, -1 if it has none, and its colour in the model: views."""
    if is_geom(target, model):
        return model.geom_matid[target : target + 1], model.geom_rgba[target]
    skin = skin_of(model, target)
    if skin >= 0:
        return model.skin_matid[skin : skin + 1], model.skin_rgba[skin]
    flex = flex_of(model, target)
    first = flex
    count = 1
    if len(model.flex_matid) != model.nflex:  # MuJoCo 4 has one for each element
        first = model.flex_elemadr[flex]
        count = model.flex_elemnum[flex]
    return model.flex_matid[first : first + count], model.flex_rgba[flex]


class _Skin:
    """Some of the vertices of a target's mesh, and triangles between them."""

    def __init__(self, waves: WaveSolver, count: int) -> None:
        V = waves.rest.mesh.V
        F = waves.rest.mesh.F
        vertices = np.arange(len(V))
        edge = np.sqrt(2 * waves.rest.areas.sum() / count)
        while len(F) > count:
            # of each cell of a grid the vertex nearest to the middle
            cells = np.floor((V - V.min(axis=0)) / edge).astype(np.int64)
            _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
            cell = cell.reshape(-1)
            middles = np.stack([np.bincount(cell, axis) for axis in V.T], axis=1) / counts[:, None]
            order = np.lexsort((np.linalg.norm(V - middles[cell], axis=1), cell))
            vertices = order[np.cumsum(counts) - counts]
            F = cell[waves.rest.mesh.F]
            F = F[(F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])]
            F = F[np.unique(np.sort(F, axis=1), axis=0, return_index=True)[1]]
            edge *= 1.1
        self._vertices = vertices
        self._F = F
        self._rest = V
        self._normals = normalized(smooth_normals(V, waves.rest.mesh.F))[vertices]
        self._sampling = waves.rest.sampling_matrix(V[vertices])

    def triangles(
        self, ripples: Ripples, name: str, data: mujoco.MjData
    ) -> tuple[NDArray[np.float64], ...]:
        """Sizes [m, 3], places [m, 3] and axes [m, 9] of triangles, as MuJoCo takes them."""
        waves = ripples[name]
        moved = ripples.vertices(name, data)
        V = self._rest
        normals = self._normals
        if moved is not None:
            V = moved
            normals = normalized(smooth_normals(moved, waves.rest.mesh.F))[self._vertices]
        position, rotation = target_pose(data, ripples.geom_ids[name])
        heights = self._sampling @ waves.height.ravel()
        points = position + (V[self._vertices] + heights[:, None] * normals) @ rotation.T
        corner, second, third = points[self._F].swapaxes(0, 1)
        first_edge = second - corner
        second_edge = third - corner
        normal = np.cross(first_edge, second_edge)
        axes = np.stack(
            [normalized(first_edge), normalized(second_edge), normalized(normal)], axis=2
        )
        first_length = np.linalg.norm(first_edge, axis=1)
        second_length = np.linalg.norm(second_edge, axis=1)
        sizes = np.stack([first_length, second_length, np.zeros(len(corner))], axis=1)
        return sizes, corner, axes.reshape(-1, 9)
