"""`PageWriter`: a run as one self-contained page."""

from __future__ import annotations

import contextlib
import html
import importlib.resources
import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ripple_sim.coupling.soft_ids import target_pose
from ripple_sim.encode.mark import MARK, made_here
from ripple_sim.render.passes.floor import find_floor
from ripple_sim.render.visuals.visual import visible_geoms

from .coding import packed, parents_of, quantised, residuals
from .page_motion import Motion
from .source import Moment, Source
from .static import floor_of, heat_colors, images, light_of, solid_parts, target_mesh, target_part

__all__ = ["PageWriter", "made_here", "writer"]

_CHUNK = 16  # frames that are decoded together
_STEP = 5e-5  # of heights, in sizes of the object
_SCRIPTS = (
    *("algebra.js", "decode.js", "motion.js", "light_shaders.js", "shaders.js", "environment.js", "light.js"),
    *("programs.js", "parts.js", "groups.js", "lit_points.js", "floor.js", "drawing.js", "player.js"),
)


class PageWriter:
    """Writes a page that plays a run: the player, what stays the same, and chunks of frames, each when it is full.

    Parameters
    ----------
    source : Source
    path : Path
    """

    def __init__(self, source: Source, path: Path) -> None:
        self._source, self._file = source, path.open("w", encoding="utf-8")
        self._meshes = {name: target_mesh(source, name) for name in source.ripples}
        self._targets = {name: target_part(source, name, mesh) for name, mesh in self._meshes.items()}
        self._parents = {name: parents_of(part.F, len(part.vertices)) for name, part in self._targets.items()}
        self._steps = {name: _STEP * float(np.ptp(mesh.rest, axis=0).max()) for name, mesh in self._meshes.items()}
        self._motions = [
            Motion(source.ripples[name].rest.mesh, self._meshes[name], part.vertices)
            for name, part in self._targets.items()
        ]
        self._told: set[int] = set()  # targets whose motion has been told of
        self._last: dict[str, Any] = {}
        self._poses: list[list[list[float]]] = []
        self._arrows: list[list[list[float]]] = []
        self._planes: list[bytes] = []
        self._frames = 0

    def write(self, moment: Moment) -> None:
        """Add a frame."""
        if not self._frames:
            self._begin(moment.data)
        self._poses.append(self._pose(moment.data))
        self._arrows.append([self._arrow(moment.data, impulse) for impulse in moment.impulses])
        for (name, mesh), motion in zip(self._meshes.items(), self._motions, strict=True):
            waves = self._source.ripples[name]
            motion.add(self._source.ripples.vertices(name, moment.data))
            heights = mesh.shape(waves.height, waves.velocity).heights[self._targets[name].vertices]
            steps = quantised(heights, self._steps[name])
            # a chunk begins from nothing, so that it can be decoded alone
            before = self._last[name] if len(self._poses) > 1 else np.zeros_like(steps)
            self._planes.append(residuals(steps, before, self._parents[name]))
            self._last[name] = steps
        self._frames += 1
        if len(self._poses) == _CHUNK:
            self._flush()

    def finish(self) -> None:
        """Complete the page."""
        self._flush()
        self._file.write(f'<script type="application/json" id="end">{{"frames": {self._frames}}}</script>\n')
        self._file.write("</body>\n</html>\n")
        self._file.close()

    def close(self) -> str:
        """Leave the page incomplete."""
        with contextlib.suppress(OSError):
            self._file.close()
        return ""

    def _begin(self, data: mujoco.MjData) -> None:
        source, model = self._source, self._source.model
        targets = set(source.ripples.geom_ids.values())
        floor = find_floor(model, [geom for geom in visible_geoms(model) if geom not in targets])
        parts = [*self._targets.values(), *solid_parts(source, -1 if floor is None else floor)]
        pose, _ = source.pose(data)
        floor_meta = floor_of(model, floor)
        meta = {
            "fps": source.fps,
            "chunk": _CHUNK,
            "steps": list(self._steps.values()),
            "parts": [part.meta for part in parts],
            "images": images(model, [part.meta for part in parts] + ([floor_meta] if floor_meta else [])),
            "floor": floor_meta,
            "light": light_of(source, data),
            "fovy": pose.fovy,
            "distance": pose.distance,
            "aspect": source.size[0] / source.size[1],
            "heat": heat_colors(),
        }
        self._file.write(_head(", ".join(self._meshes)))
        arrays = b"".join(array.tobytes() for part in parts for array in part.arrays)
        self._file.write(f'<script type="application/json" id="meta">{json.dumps(meta)}</script>\n')
        self._file.write(f'<script type="text/plain" id="arrays">{packed(arrays)}</script>\n')

    def _pose(self, data: mujoco.MjData) -> list[list[float]]:
        """Position and quaternion of the camera and of all bodies."""
        pose, _ = self._source.pose(data)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose.rotation).ravel())
        rows = np.concatenate([[[*pose.position, *quaternion]], np.concatenate([data.xpos, data.xquat], axis=1)])
        return np.round(rows, 5).tolist()

    def _arrow(self, data: mujoco.MjData, impulse: Any) -> list[float]:
        """Point and inward direction in the world, and impulse [N s]."""
        ripples = self._source.ripples
        _, rotation = target_pose(data, ripples.geom_ids[impulse.geom])
        inwards = -rotation @ ripples[impulse.geom].atlas.normals[impulse.texel] * (-1 if impulse.inner else 1)
        return [round(float(x), 5) for x in (*impulse.point, *inwards, impulse.impulse)]

    def _flush(self) -> None:
        """Write the frames that wait as a chunk."""
        if self._poses:
            middles, moved = self._moved()
            text = json.dumps({"poses": self._poses, "arrows": self._arrows, "middles": middles}).encode()
            content = len(text).to_bytes(4, "little") + text + b"".join(self._planes + moved)
            self._file.write(f'<script type="text/plain" class="chunk">{packed(content)}</script>\n')
            self._file.flush()
        self._poses, self._arrows, self._planes = [], [], []

    def _moved(self) -> tuple[dict[int, list[list[float]]], list[bytes]]:
        """Middles and coded vertices of the targets that move, by number; each is told of before it first does."""
        middles, planes = {}, []
        for number, motion in enumerate(self._motions):
            places, coded = motion.chunk()
            if not motion.moves:
                continue
            if number not in self._told:
                told = json.dumps(motion.told())
                self._file.write(
                    f'<script type="application/json" class="motion" data-target="{number}">{told}</script>\n'
                )
                self._told.add(number)
            middles[number] = places
            planes.append(coded)
        return middles, planes


def writer(source: Source, path: Path) -> PageWriter:
    """Begin a page."""
    return PageWriter(source, path)


def _head(title: str) -> str:
    def read(name: str) -> str:
        return importlib.resources.files(__package__).joinpath("html", name).read_text("utf-8")

    page = read("page.html")
    scripts = "\n".join(f"<script>\n{read(name)}</script>" for name in _SCRIPTS)
    return page.replace("TITLE", html.escape(title)).replace("MARK", MARK).replace("SCRIPTS", scripts)
