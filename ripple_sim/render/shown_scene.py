"""Which of a scene's entries are drawn as what: rippling surfaces, the floor, and everything else.

An entry is compared with what it showed in the frame before, so that a frame in which only poses
change costs little.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import target_name
from ripple_sim.coupling.model import find_flex_colliders
from ripple_sim.coupling.soft import is_soft

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
from .visuals.visual import WALLS, Visual, geom_visual

_OPAQUE = 0.995  # opacity from which MuJoCo draws something as opaque
_FROM_BEHIND = 0.3  # opacity of planes that are seen from behind, over that from the front
# Of the model's materials, what entries of a scene do not repeat.
_MATERIALS = ("mat_texid", "mat_texrepeat", "mat_texuniform", "mat_roughness", "mat_metallic")


class ShownScene:
    """What a scene of MuJoCo's shows.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids of the rippling surfaces, which are drawn in the place of their geoms.
    floor : int, optional
        Geom id of the plane that is drawn as the floor, where it is seen from above and opaque.
    cut_out : bool
        Whether it is drawn as the floor from above in any case, and not at all from below: only its
        shadows are left.

    Attributes
    ----------
    visuals : list of (Visual, NamedShape)
        All that is neither.
    targets : dict of int to Visual
        What the scene says of the targets that it has, by geom id.
    floor : Visual, optional
        Likewise.
    hidden : list of int
        Targets that are not drawn.
    left_out : set of str
        What is not drawn as the scene has it, in words.
    """

    def __init__(
        self, model: Any, targets: Iterable[int], floor: int | None, cut_out: bool = False
    ) -> None:
        self._model = model
        self._cut_out = cut_out
        self._targets = {geom_visual(model, target).identity: target for target in targets}
        self._own = {target: geom_visual(model, target) for target in self._targets.values()}
        self._floor = None if floor is None else geom_visual(model, floor)
        flex = int(mujoco.mjtObj.mjOBJ_FLEX)
        self._colliders = {(collider, flex) for collider in find_flex_colliders(model).values()}
        self._content: list[tuple[Any, ...]] | None = None
        self._own_entries = EntryPoses(model, [])
        self._placed: list[tuple[Visual, mujoco.MjvGeom]] = []
        self.visuals: list[tuple[Visual, NamedShape]] = []
        self.targets: dict[int, Visual] = {}
        self.floor: Visual | None = None
        self.hidden: list[int] = []
        self.left_out: set[str] = set()

    def read(
        self,
        scene: mujoco.MjvScene,
        eye: NDArray[np.float64],
        segmented: bool,
        assets: Assets,
        doubled: bool = False,
    ) -> bool:
        """Take in what a scene has, seen from an eye [m]; whether that is something else than before, but for poses.

        Of what is `segmented` there is only what has a number for it. With `doubled` what is
        transparent is as opaque as in MuJoCo, which draws it twice.
        """
        entries = [each for each in scene.geoms[: scene.ngeom] if each.segid >= 0 or not segmented]
        content: list[tuple[Any, ...]] = [
            (*content_of(each), is_behind(each, eye)) for each in entries
        ]
        content.append(
            (assets.version, *(getattr(self._model, name).tobytes() for name in _MATERIALS))
        )
        if content == self._content:
            self._place()
            return False
        self._content = content
        self._eye = eye
        self._doubled = doubled
        self._sort(scene, entries, assets.reshaped)
        return True

    def poses(self, data: Any) -> Any:
        """Where geoms and sites are, by names of MuJoCo's data: as the scene has them."""
        return self._own_entries.of(data)

    def _sort(
        self,
        scene: mujoco.MjvScene,
        entries: list[mujoco.MjvGeom],
        reshaped: Collection[tuple[str, int]],
    ) -> None:
        self.targets = {}
        self.floor = None
        self.left_out = set()
        self._placed = []
        visuals: list[Visual] = []
        own: dict[tuple[int, int], mujoco.MjvGeom] = {}
        for entry in entries:
            identity = identity_of(entry)
            if entry.label:
                self.left_out.add("labels")
            first = identity not in own
            if first and (is_of_model(self._model, entry) or identity in self._targets):
                own[identity] = entry
            if first and identity in self._targets and self._ripples(entry):
                self._take_target(self._targets[identity], entry)
                if self._doubled and entry.type == mujoco.mjtGeom.mjGEOM_HFIELD:
                    walls = own_visual(self._model, entry, reshaped)
                    visuals.append(self._as_seen(replace(walls, part=WALLS), entry))
            elif first and self._is_floor(entry):
                self.floor = own_visual(self._model, entry)
            elif self._cut_out and self._floor is not None and identity == self._floor.identity:
                continue
            elif identity not in self._colliders:
                found = [
                    self._as_seen(each, entry)
                    for each in visuals_in(self._model, scene, entry, not first, reshaped)
                ]
                visuals += found
                if len(found) == 1 and found[0].pose is not None and found[0].corners is None:
                    self._placed.append((found[0], entry))
        self.visuals = shaped(self._model, visuals)
        drawn = {visual.kind for visual, _ in self.visuals}
        self.left_out |= {_name_of(visual.kind) for visual in visuals if visual.kind not in drawn}
        self.hidden = [
            target
            for target, each in self._own.items()
            if target not in self.targets and each.visible
        ]
        self._own_entries = EntryPoses(self._model, list(own.values()))

    def _place(self) -> None:
        """Bring the poses of what is none of the model's up to date."""
        for visual, entry in self._placed:
            position, rotation = visual.pose  # type: ignore[misc]
            position[:] = entry.pos
            rotation[:] = entry.mat

    def _ripples(self, entry: mujoco.MjvGeom) -> bool:
        """Whether an entry of a target still has the shape of the rippling surface."""
        target = self._targets[identity_of(entry)]
        if is_soft(self._model, target):
            return True
        own = self._own[target]
        visual = own_visual(self._model, entry)
        same = visual.kind == own.kind and visual.asset == own.asset
        same &= np.array_equal(
            visual.half_sizes.astype(np.float32), own.half_sizes.astype(np.float32)
        )
        if not same:
            self.left_out.add(
                f"the ripples of {target_name(self._model, target)!r}, which has another shape"
            )
        return bool(same)

    def _take_target(self, target: int, entry: mujoco.MjvGeom) -> None:
        paint: dict[str, Any] = {
            "rgba": np.array(entry.rgba, dtype=np.float64),
            "material": int(entry.matid),
        }
        if is_soft(self._model, target):
            visual = replace(geom_visual(self._model, target), **paint)
        else:
            visual = own_visual(self._model, entry)
        self.targets[target] = self._as_seen(visual, entry)

    def _is_floor(self, entry: mujoco.MjvGeom) -> bool:
        """Whether an entry is the floor, and drawn as such."""
        if self._floor is None or identity_of(entry) != self._floor.identity:
            return False
        return not is_behind(entry, self._eye) and (self._cut_out or entry.rgba[3] >= _OPAQUE)

    def _as_seen(self, visual: Visual, entry: mujoco.MjvGeom) -> Visual:
        """A visual with the opacity with which MuJoCo shows it: less of planes from behind."""
        behind = is_behind(entry, self._eye)
        opacity = float(visual.rgba[3]) * (_FROM_BEHIND if behind else 1.0)
        if self._doubled and opacity < _OPAQUE:
            opacity = 1.0 - (1.0 - opacity) ** 2
        return replace(visual, behind=behind, shown_opacity=opacity)


def _name_of(kind: int) -> str:
    """Name of a type of geom, or its number where it is none of MuJoCo's."""
    try:
        return mujoco.mjtGeom(kind).name
    except ValueError:
        return f"geoms of type {kind}"
