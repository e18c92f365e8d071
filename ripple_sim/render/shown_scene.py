"""The entries of a scene, sorted by how they are drawn: as targets, as the floor, or otherwise.

The entries are compared with those of the frame before, so that a frame in which only poses change
takes little time.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import target_name
from ripple_sim.coupling.ids import GeomId, TargetId, is_geom
from ripple_sim.coupling.model import find_flex_colliders

from .visuals.geoms import shaped
from .visuals.objects import Assets
from .visuals.scene_entries import (
    EntryPoses,
    content_of,
    identity_of,
    is_behind,
    is_of_model,
    own_visual,
    visuals_in,
)
from .visuals.shapes import NamedShape
from .visuals.visual import WALLS, Visual, geom_visual, target_visual

# Opacity from which MuJoCo draws an object as opaque.
_MIN_OPAQUE = 0.995

# Opacity of planes that are seen from behind, as a share of the opacity from the front.
_OPACITY_FROM_BEHIND = 0.3

# Arrays of the model's materials whose values a scene's entries do not contain.
_MATERIAL_ARRAYS = ("mat_texid", "mat_texrepeat", "mat_texuniform", "mat_roughness", "mat_metallic")


class ShownScene:
    """The visible contents of a scene of MuJoCo's.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids of the rippling surfaces, which are drawn instead of their geoms.
    floor : int, optional
        Geom id of the plane that is drawn as the floor, if it is opaque and seen from above.
    cut_out : bool
        Whether frames show only the shadows on the floor. The plane is then drawn as the floor from
        above even if it is transparent, and not at all from below.

    Attributes
    ----------
    visuals : list of (Visual, NamedShape)
        Everything except targets and floor.
    targets : dict of TargetId to Visual
        Visuals of the targets that the scene contains.
    floor : Visual, optional
        Visual of the floor, if the scene contains it.
    hidden : list of TargetId
        Targets that are not drawn.
    left_out : set of str
        Descriptions of things that are not drawn as the scene has them.
    """

    def __init__(
        self, model: Any, targets: Iterable[TargetId], floor: GeomId | None, cut_out: bool = False
    ) -> None:
        self._model = model
        self._cut_out = cut_out
        # targets by identity, and their visuals in the model
        self._targets = {target_visual(model, target).identity: target for target in targets}
        self._model_visuals = {
            target: target_visual(model, target) for target in self._targets.values()
        }
        self._floor = None if floor is None else geom_visual(model, floor)
        flex = int(mujoco.mjtObj.mjOBJ_FLEX)
        self._colliders = {(collider, flex) for collider in find_flex_colliders(model).values()}
        self._content: list[tuple[Any, ...]] | None = None  # of the frame before
        self._poses = EntryPoses(model, [])
        # visuals that are not of the model, and the entries that they follow
        self._placed: list[tuple[Visual, mujoco.MjvGeom]] = []
        self.visuals: list[tuple[Visual, NamedShape]] = []
        self.targets: dict[TargetId, Visual] = {}
        self.floor: Visual | None = None
        self.hidden: list[TargetId] = []
        self.left_out: set[str] = set()

    def read(
        self,
        scene: mujoco.MjvScene,
        eye: NDArray[np.float64],
        segmented: bool,
        assets: Assets,
        doubled: bool = False,
    ) -> bool:
        """Read a scene, and return whether anything except poses has changed.

        Parameters
        ----------
        eye : array, shape [3]
            Position of the camera [m].
        segmented : bool
            Whether entries without a `segid` are left out.
        doubled : bool
            Whether transparent objects are as opaque as in MuJoCo, which draws them twice.
        """
        entries = [
            entry for entry in scene.geoms[: scene.ngeom] if entry.segid >= 0 or not segmented
        ]
        content: list[tuple[Any, ...]] = [
            (*content_of(entry), is_behind(entry, eye)) for entry in entries
        ]
        materials = [getattr(self._model, name).tobytes() for name in _MATERIAL_ARRAYS]
        content.append((assets.version, *materials))
        if content == self._content:
            self._place()
            return False
        self._content = content
        self._eye = eye
        self._doubled = doubled
        self._sort(scene, entries, assets.reshaped)
        return True

    def poses(self, data: Any) -> Any:
        """Poses of geoms and sites as the scene has them, by the names of `mujoco.MjData`."""
        return self._poses.of(data)

    def _sort(
        self,
        scene: mujoco.MjvScene,
        entries: list[mujoco.MjvGeom],
        reshaped: Collection[tuple[str, int]],
    ) -> None:
        """Sort the entries into targets, floor and other visuals; `reshaped` is of `Assets`."""
        self.targets = {}
        self.floor = None
        self.left_out = set()
        self._placed = []
        visuals: list[Visual] = []
        # the first entry of each object of the model; further entries are decoration
        model_entries: dict[tuple[int, int], mujoco.MjvGeom] = {}
        for entry in entries:
            identity = identity_of(entry)
            if entry.label:
                self.left_out.add("labels")
            is_first = identity not in model_entries
            if is_first and (is_of_model(self._model, entry) or identity in self._targets):
                model_entries[identity] = entry
            if is_first and identity in self._targets and self._ripples(entry):
                self._take_target(self._targets[identity], entry)
                if self._doubled and entry.type == mujoco.mjtGeom.mjGEOM_HFIELD:
                    walls = own_visual(self._model, entry, reshaped)
                    visuals.append(self._as_seen(replace(walls, part=WALLS), entry))
            elif is_first and self._is_floor(entry):
                self.floor = own_visual(self._model, entry)
            elif self._cut_out and self._floor is not None and identity == self._floor.identity:
                continue
            elif identity not in self._colliders:
                entry_visuals = visuals_in(self._model, scene, entry, not is_first, reshaped)
                visuals += self._see(entry_visuals, entry)
        self.visuals = shaped(self._model, visuals)
        drawn_kinds = {visual.kind for visual, _ in self.visuals}
        self.left_out |= {
            _name_of(visual.kind) for visual in visuals if visual.kind not in drawn_kinds
        }
        self.hidden = [
            target
            for target, visual in self._model_visuals.items()
            if target not in self.targets and visual.visible
        ]
        self._poses = EntryPoses(self._model, list(model_entries.values()))

    def _see(self, visuals: Iterable[Visual], entry: mujoco.MjvGeom) -> list[Visual]:
        """The visuals of an entry, as the camera sees them; they follow the entry's pose."""
        seen = [self._as_seen(visual, entry) for visual in visuals]
        if len(seen) == 1 and seen[0].pose is not None and seen[0].corners is None:
            self._placed.append((seen[0], entry))
        return seen

    def _place(self) -> None:
        """Bring the poses of visuals that are not of the model up to date."""
        for visual, entry in self._placed:
            position, rotation = visual.pose  # type: ignore[misc]
            position[:] = entry.pos
            rotation[:] = entry.mat

    def _ripples(self, entry: mujoco.MjvGeom) -> bool:
        """Whether an entry of a target still has the shape of the rippling surface."""
        target = self._targets[identity_of(entry)]
        if not is_geom(target, self._model):
            return True
        in_model = self._model_visuals[target]
        in_scene = own_visual(self._model, entry)
        # entries have single precision
        has_same_size = np.array_equal(
            in_scene.half_sizes.astype(np.float32), in_model.half_sizes.astype(np.float32)
        )
        has_same_shape = (
            in_scene.kind == in_model.kind and in_scene.asset == in_model.asset and has_same_size
        )
        if not has_same_shape:
            self.left_out.add(
                f"the ripples of {target_name(self._model, target)!r}, which has another shape"
            )
        return has_same_shape

    def _take_target(self, target: TargetId, entry: mujoco.MjvGeom) -> None:
        """Add a target with the colour and material of its entry."""
        paint: dict[str, Any] = {
            "rgba": np.array(entry.rgba, dtype=np.float64),
            "material": int(entry.matid),
        }
        if is_geom(target, self._model):
            visual = own_visual(self._model, entry)
        else:
            visual = replace(target_visual(self._model, target), **paint)
        self.targets[target] = self._as_seen(visual, entry)

    def _is_floor(self, entry: mujoco.MjvGeom) -> bool:
        """Whether an entry is the floor's, and is drawn as the floor."""
        if self._floor is None or identity_of(entry) != self._floor.identity:
            return False
        is_opaque = entry.rgba[3] >= _MIN_OPAQUE
        return not is_behind(entry, self._eye) and (self._cut_out or is_opaque)

    def _as_seen(self, visual: Visual, entry: mujoco.MjvGeom) -> Visual:
        """A visual with its opacity in MuJoCo, which is smaller for planes from behind."""
        behind = is_behind(entry, self._eye)
        opacity = float(visual.rgba[3]) * (_OPACITY_FROM_BEHIND if behind else 1.0)
        if self._doubled and opacity < _MIN_OPAQUE:
            opacity = 1.0 - (1.0 - opacity) ** 2  # drawn twice
        return replace(visual, behind=behind, shown_opacity=opacity)


def _name_of(kind: int) -> str:
    """Name of a type of geom; a description with its number if MuJoCo has no such type."""
    try:
        return mujoco.mjtGeom(kind).name
    except ValueError:
        return f"geoms of type {kind}"
