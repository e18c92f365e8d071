"""`PageContent`: what a page is made of, as text: constant content, and chunks of frames.

The page solves the waves itself wherever it can, so that its surfaces can be poked: it has the law
of each surface's waves (`wave_law`) and the recorded loads. What stays the same over time, meshes,
looks, textures, camera and light, is written once. Triangles and vertices come in an order in which
neighbours are close together: drawing then computes a vertex about once and not once for each of
its triangles, and recorded heights are predicted well from earlier ones.
"""

from __future__ import annotations

import html
import importlib.resources
import json
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft import target_pose
from ripple_sim.encode.replace import MARK
from ripple_sim.overlay.color_map import color_table
from ripple_sim.render.passes.floor import find_floor

from .page_coding import packed
from .page_parts import PagePart, data_uri, floor_of, light_of, solid_part
from .page_target import PageTarget
from .source import Source
from .visuals import solids

_SEGMENTS = 6  # of a primitive to a right angle
# The page's scripts, in the order in which they are joined.
_SCRIPTS = (
    "algebra.js",
    "decode.js",
    "motion.js",
    "stream.js",
    "law.js",
    "wave_loop.js",
    "programs.js",
    "wave_pass.js",
    "texel_heights.js",
    "surface.js",
    "timeline.js",
    "poke.js",
    "light_shaders.js",
    "shaders.js",
    "environment.js",
    "light.js",
    "smoothing.js",
    "parts.js",
    "groups.js",
    "lit_points.js",
    "floor.js",
    "arrow.js",
    "drawing.js",
    "grid.js",
    "detail.js",
    "rival.js",
    "player.js",
    "program.js",
    "controls.js",
)


class PageChunk(NamedTuple):
    """Some frames of a page.

    Attributes
    ----------
    motions : dict of int to dict
        The meshes of targets that move from now on, by the targets' numbers.
    content : bytes
        The frames, for decode.js.
    """

    motions: dict[int, dict[str, Any]]
    content: bytes


class PageContent:
    """The content of a page of a source, from the first frame on.

    Attributes
    ----------
    targets : dict of str to PageTarget
    waiting : int
        Frames that no chunk has yet.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self.targets = {name: PageTarget(source, name) for name in source.ripples}
        self._with_motion: set[int] = set()  # targets whose mesh for motion is written
        self._poses: list[list[list[float]]] = []
        self._arrows: list[list[list[float]]] = []

    @property
    def waiting(self) -> int:
        """Frames that no chunk has yet."""
        return len(self._poses)

    def begin(self, data: mujoco.MjData, **settings: Any) -> Iterator[str]:
        """Texts of everything that stays the same, in order; the recording begins with them.

        `settings` are for the page's description.
        """
        folder = importlib.resources.files(__package__).joinpath("html")
        page = folder.joinpath("page.html").read_text("utf-8")
        title = html.escape(", ".join(self.targets))
        yield page.replace("TITLE", title).replace("MARK", MARK)
        for shader in sorted(folder.joinpath("shaders").iterdir(), key=lambda file: file.name):
            text = shader.read_text("utf-8")
            yield f'<script type="x-shader" id="{shader.name}">\n{text}</script>\n'
        parts = self._parts()
        arrays = bytearray()
        for part in parts:
            for array in part.arrays:
                arrays += array.tobytes()
        yield json_script('id="meta"', {**self._meta(parts, data), **settings})
        yield f'<script type="text/plain" id="arrays">{packed(bytes(arrays))}</script>\n'
        for number, target in enumerate(self.targets.values()):
            law = target.begin()
            if law:
                attributes = f'class="law" data-target="{number}"'
                yield f'<script type="application/json" {attributes}>{law}</script>\n'
        scripts = [folder.joinpath(name).read_text("utf-8") for name in _SCRIPTS]
        yield '<script type="module">\n' + "\n".join(scripts) + "</script>\n"

    def add(self, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame."""
        ripples = self._source.ripples
        self._poses.append(self._places(data))
        self._arrows.append([])
        for hit in impulses:
            _, rotation = target_pose(data, ripples.geom_ids[hit.geom])
            normal = ripples[hit.geom].atlas.normals[hit.texel]
            inwards = -rotation @ normal * (-1 if hit.inner else 1)
            # point [m] and inward direction in the world, and impulse [N s]
            arrow = (*hit.point, *inwards, hit.impulse)
            self._arrows[-1].append([round(float(x), 5) for x in arrow])
        for name, target in self.targets.items():
            target.add(ripples.vertices(name, data))

    def changed_laws(self) -> dict[int, str]:
        """Laws of surfaces that another material, a reset or the like has changed, by number.

        They begin with the latest frame that was added. A page that is written to a file replays
        these surfaces instead.
        """
        laws = {number: target.renewed() for number, target in enumerate(self.targets.values())}
        return {number: law for number, law in laws.items() if law}

    def rival_laws(self, operator: str) -> dict[int, str]:
        """Laws of the surfaces that the page solves, by another wave operator, by number.

        They begin with the present state, which must be that of the latest frame.
        """
        targets = enumerate(self.targets.values())
        laws = {number: target.rival_law(operator) for number, target in targets}
        return {number: law for number, law in laws.items() if law}

    def looks(self, source: Source, names: Sequence[str]) -> dict[int, dict[str, Any]]:
        """How targets look by a source with other paints, by the targets' numbers."""
        numbers = {name: number for number, name in enumerate(self.targets)}
        return {numbers[name]: self.targets[name].look(source) for name in names}

    def chunk(self) -> PageChunk:
        """The frames that wait."""
        middles: dict[int, list[list[float]]] = {}  # of the targets that move, by number
        waves: dict[int, list[list[Any]]] = {}  # events of the targets that the page solves
        heights: list[list[bytes]] = []  # of the others
        moved: list[bytes] = []
        motions: dict[int, dict[str, Any]] = {}
        for number, target in enumerate(self.targets.values()):
            events, coded = target.flush()
            if events is None:
                heights.append(coded)
            else:
                waves[number] = events
            places, coded_places = target.places()
            if not target.moves:
                continue
            if number not in self._with_motion:
                motions[number] = target.motion()
                self._with_motion.add(number)
            middles[number] = places
            moved.append(coded_places)
        frames = {"poses": self._poses, "arrows": self._arrows, "middles": middles, "waves": waves}
        text = json.dumps(frames).encode()
        by_frame: list[bytes] = []
        for planes in zip(*heights, strict=True):
            by_frame += planes
        self._poses = []
        self._arrows = []
        text_length = len(text).to_bytes(4, "little")
        return PageChunk(motions, text_length + text + b"".join(by_frame + moved))

    def end(self) -> None:
        """End all recordings."""
        for target in self.targets.values():
            target.end()

    def _places(self, data: mujoco.MjData) -> list[list[float]]:
        """Position [m] and quaternion of the camera and of all bodies."""
        pose = self._source.pose(data)
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(pose.rotation).ravel())
        places = np.vstack([[*pose.position, *turn], np.hstack([data.xpos, data.xquat])])
        return np.round(places, 5).tolist()

    def _parts(self) -> list[PagePart]:
        """The meshes: targets first, then solid geoms other than the floor."""
        targets = set(self._source.ripples.geom_ids.values())
        floor = find_floor(self._source.model, targets)
        left_out = targets if floor is None else targets | {floor}
        parts = [target.part for target in self.targets.values()]
        return parts + [
            solid_part(self._source.model, solid)
            for solid in solids(self._source.model, left_out, _SEGMENTS)
        ]

    def _meta(self, parts: list[PagePart], data: mujoco.MjData) -> dict[str, Any]:
        """The description of everything that stays the same over time."""
        source = self._source
        model = source.model
        floor = find_floor(model, set(source.ripples.geom_ids.values()))
        floor_meta = None if floor is None else floor_of(model, floor)
        aspect = source.size[0] / source.size[1]
        pose = source.pose(data).in_perspective(aspect, "the page")
        textured = [part.meta for part in parts] + ([floor_meta] if floor_meta else [])
        textures = {surface["texture"] for surface in textured if surface["texture"] >= 0}
        textures |= {each["glow"] for each in textured if each.get("glow", -1) >= 0}
        return {
            "fps": source.fps,
            "slowMotion": source.slow_motion,
            "steps": [target.step for target in self.targets.values()],
            "parts": [part.meta for part in parts],
            "images": {texture: data_uri(model, texture) for texture in sorted(textures)},
            "floor": floor_meta,
            "light": light_of(source, data),
            "fovy": pose.fovy,
            "distance": pose.distance,
            "aspect": aspect,
            # of the heights, from the lowest to the highest, sRGB
            "heat": color_table()[::8].tolist(),
        }


def json_script(attributes: str, content: Any) -> str:
    """A script element with content for the page's own scripts."""
    return f'<script type="application/json" {attributes}>{json.dumps(content)}</script>\n'
