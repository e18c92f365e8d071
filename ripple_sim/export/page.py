"""`PageWriter`: a run as one self-contained page, which plays in any browser and inside a notebook.

What stays the same over time, meshes, looks, textures, camera and light, is written once. Heights
and moving vertices are predicted from earlier ones and the frame before, and deflated. Triangles
and vertices come in an order in which neighbours are close together: drawing then computes a vertex
about once and not once for each of its triangles, and heights are predicted well from earlier ones.
"""

from __future__ import annotations

import base64
import html
import importlib.resources
import io
import json
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.coupling.ids import GeomId, is_geom
from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft import target_pose
from ripple_sim.encode.replace import MARK, made_here
from ripple_sim.overlay.color_map import color_table
from ripple_sim.render.passes.floor import find_floor
from ripple_sim.render.surfaces.vertices import memory_order
from ripple_sim.render.visuals.lights import SOFT_BOX_LIGHTS, lighting_of
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import geom_visual, texture_pixels

from .moving_mesh import MovingMesh
from .source import Source, Writer
from .visuals import Finish, Solid, mean_color, solids, target_finish

__all__ = ["PageWriter", "made_here"]

_MAX_TRIANGLES = 16_000  # of a target, about
_SEGMENTS = 6  # of a primitive to a right angle
_MAX_IMAGE_SIZE = 1024  # of a texture, along a side [pixels]

_MAX_STEPS = 1 << 20  # of a quantised height or coordinate
_HEIGHT_STEP = 5e-5  # of heights, in sizes of the object
_PLACE_STEP = 2e-5  # of the coordinates of moving vertices, in sizes of the mesh
_CHUNK = 16  # frames that are decoded together

# The page's scripts, in the order in which they are joined.
_SCRIPTS = (
    "algebra.js",
    "decode.js",
    "motion.js",
    "light_shaders.js",
    "shaders.js",
    "environment.js",
    "light.js",
    "programs.js",
    "parts.js",
    "groups.js",
    "lit_points.js",
    "floor.js",
    "drawing.js",
    "player.js",
)


class PagePart(NamedTuple):
    """A mesh of a page.

    Attributes
    ----------
    meta : dict
        Its description, for the page's JSON.
    arrays : list
        Its coded arrays.
    F : int64 [m, 3]
        Triangles.
    vertices : int64 [n]
        Numbers that its vertices have in the source.
    """

    meta: dict[str, Any]
    arrays: list[NDArray]
    F: NDArray[np.int64]
    vertices: NDArray[np.int64]


def target_part(source: Source, name: str, mesh: MovingMesh) -> PagePart:
    """A target at rest; its points follow along `directions`, and with its mesh's own vertices."""
    model = source.model
    geom = source.ripples.geom_ids[name]
    finish, uv = target_finish(source, name, mesh)
    soft = not is_geom(geom, model)  # and so in the world
    meta = {
        "name": name,
        "target": True,
        "body": 0 if soft else int(model.geom_bodyid[geom]),
        "position": [0, 0, 0] if soft else model.geom_pos[geom].tolist(),
        "quaternion": [1, 0, 0, 0] if soft else model.geom_quat[geom].tolist(),
        "open": not source.ripples[name].atlas.mesh.closed,
    }
    return _part(meta, finish, mesh.F, [mesh.rest, mesh.directions], uv)


def floor_of(model: mujoco.MjModel, geom: GeomId) -> dict[str, Any]:
    """The floor: height, albedo and texture."""
    visual = geom_visual(model, geom)
    mapping = mapping_of(model, visual)
    return {
        "body": int(model.geom_bodyid[geom]),
        "position": model.geom_pos[geom].tolist(),
        "quaternion": model.geom_quat[geom].tolist(),
        "half": [float(x) if x > 0 else 0.0 for x in visual.size[:2]],
        "color": visual.color.tolist(),
        "mean": (visual.color * mean_color(model, mapping)).tolist(),
        "texture": mapping.texture if mapping.texture >= 0 else -1,
        "tiling": list(mapping.tiling),
    }


def light_of(source: Source, data: mujoco.MjData) -> dict[str, Any]:
    """Lamps, soft boxes and ambient light, as the renderer has them at the first frame."""
    pose = source.pose(data)
    lighting = lighting_of(source.model, data, pose, source.lighting)
    studio = lighting.studio
    lamps = [
        {
            # in the camera's frame where the lamp turns with it
            "direction": light.direction.tolist(),
            "head": bool(
                not studio
                and np.allclose(light.direction, pose.rotation[:, 2])
                and light.position is None
            ),
            "radiance": light.radiance.tolist(),
            "position": None if light.position is None else light.position.tolist(),
            "size": light.size,
            "cutoff": float(np.cos(light.cutoff)),
            "exponent": light.exponent,
            "falloff": light.falloff.tolist(),
            "gloss": light.gloss,
            "shadow": light.shadow,
        }
        for light in lighting.lights[:4]
    ]
    return {
        "studio": studio,
        "lamps": lamps,
        "ambient": lighting.ambient.tolist(),
        "boxes": [[*map(float, box[:4]), *map(float, box[4])] for box in SOFT_BOX_LIGHTS],
    }


def _solid_part(solid: Solid) -> PagePart:
    meta = {
        "name": solid.name,
        "target": False,
        "body": solid.body,
        "position": solid.position.tolist(),
        "quaternion": solid.quaternion.tolist(),
        "open": False,
    }
    return _part(meta, solid.finish, solid.F, [solid.points, solid.normals], solid.uv)


def _part(
    meta: dict[str, Any], finish: Finish, F: NDArray, fields: list[NDArray], uv: NDArray | None
) -> PagePart:
    """Code points and directions in 16 bits each, triangles, and corners' texture coordinates."""
    names = ("roughness", "metallic", "sheen", "coat", "translucency", "transparency", "emission")
    values = {name: float(getattr(finish.look, name)) for name in names}
    look = {
        "color": finish.color.tolist(),
        "opacity": finish.opacity,
        "texture": finish.texture,
        **values,
    }
    F, vertices, triangles = memory_order(F, fields[0])
    points, directions = (np.asarray(field, np.float64)[vertices] for field in fields)
    low = points.min(axis=0)
    size = max(float(np.ptp(points, axis=0).max()), 1e-9)
    place = np.rint((points - low) / size * 65535).astype("<u2")
    arrays = [place, np.rint(directions * 32767).astype("<i2"), F.astype("<u4")]
    if uv is not None:
        arrays.append(np.asarray(uv, "<f4")[triangles])
    counts = {"points": len(points), "triangles": len(F), "textured": uv is not None}
    return PagePart(
        {**meta, **look, "low": low.tolist(), "size": size, **counts}, arrays, F, vertices
    )


def _data_uri(model: mujoco.MjModel, texture: int) -> str:
    image = Image.fromarray(texture_pixels(model, texture))
    image.thumbnail((_MAX_IMAGE_SIZE, _MAX_IMAGE_SIZE))
    file = io.BytesIO()
    kind = "jpeg" if image.width > 64 else "png"
    image.save(file, kind, quality=88)  # which JPEG alone has
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"


def parents_of(F: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Two earlier vertices from which each vertex is predicted, [count, 2]; -1 without.

    They are the other two of the first triangle in which it is the last, or else twice the first of
    the first triangle in which it is the second. decode.js finds the same ones.
    """
    ordered = np.sort(F, axis=1)
    parents = np.full((count, 2), -1)
    for column in (1, 2):
        vertices, first = np.unique(ordered[:, column], return_index=True)
        parents[vertices] = ordered[first, :column]
    return parents


def quantised(heights: NDArray[np.float32], step: float) -> NDArray[np.int64]:
    """Heights [n] in whole steps [m]."""
    return np.clip(np.rint(heights / step), -_MAX_STEPS, _MAX_STEPS).astype(np.int64)


def residuals(
    now: NDArray[np.int64], before: NDArray[np.int64], parents: NDArray[np.int64]
) -> bytes:
    """Errors of the prediction of steps [n] from the frame before and from the parents.

    The low bytes of all come first, then the higher bytes.
    """
    change = np.append(now - before, 0)  # the last entry: no parent, no change
    predicted = change[parents[:, 0]] + change[parents[:, 1]] >> 1
    error = change[:-1] - predicted
    zigzag = np.where(error < 0, -2 * error - 1, 2 * error).astype("<u4")
    # the prediction's error may take 23 bits
    return b"".join((zigzag >> shift & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))


def packed(content: bytes) -> str:
    """Deflated bytes as text."""
    return base64.b64encode(zlib.compress(content, 9)).decode()


class PageTarget:
    """A target: its part of the page, and over time its heights and the vertices of its own mesh.

    The part's finer surface follows that mesh, of which nothing is written while it rests. `step`
    is that of heights.
    """

    def __init__(self, source: Source, name: str) -> None:
        self._waves = source.ripples[name]
        self._surface = MovingMesh(
            self._waves.rest, source.tessellation, source.limited[name], _MAX_TRIANGLES
        )
        self.part = target_part(source, name, self._surface)
        self.step = _HEIGHT_STEP * float(np.ptp(self._surface.rest, axis=0).max())
        self._point_parents = parents_of(self.part.F, len(self.part.vertices))
        mesh = self._waves.rest.mesh
        self._rest = mesh.V
        (self._F, self._order, _) = memory_order(mesh.F, mesh.V)
        self._parents = parents_of(self._F, len(mesh.V))
        self._place_step = _PLACE_STEP * float(np.ptp(mesh.V, axis=0).max())
        self._frames: list[NDArray[np.float64]] = []
        self._last = np.zeros(0, np.int64)  # steps of the frame before
        self.moves = False

    def add(self, V: NDArray[np.float64] | None) -> bytes:
        """Add a frame; return its coded heights.

        `V` are the vertices of the target's mesh [m], if they have moved.
        """
        heights = self._surface.shape(self._waves.height, self._waves.velocity).height[
            self.part.vertices
        ]
        steps = quantised(heights, self.step)
        # a chunk begins from nothing, so that it can be decoded alone
        before = self._last if self._frames else np.zeros_like(steps)
        self._last = steps
        self.moves = self.moves or V is not None
        self._frames.append(self._rest if V is None else np.array(V))
        return residuals(steps, before, self._point_parents)

    def motion(self) -> dict[str, Any]:
        """The mesh at rest, and the way in which the page's points ride on it."""
        corners, weights, off, _, _ = self._surface.vertices.rest
        points = self.part.vertices
        far = max(float(np.abs(off).max()), 1e-30)  # largest offset from the mesh [m]
        arrays = [
            self._rest[self._order].astype("<f4"),
            self._F.astype("<u4"),
            np.argsort(self._order)[corners[points]].astype("<u4"),
            np.rint(weights[points, :2] * 65535).astype("<u2"),
            np.rint(off[points] / far * 32767).astype("<i2"),
        ]
        meta = {
            "points": len(self._order),
            "triangles": len(self._F),
            "step": self._place_step,
            "far": far,
        }
        return {**meta, "arrays": packed(b"".join(array.tobytes() for array in arrays))}

    def chunk(self) -> tuple[list[list[float]], bytes]:
        """Middles [m] and coded vertices of the frames since the last chunk.

        Both are empty if the surface never moved.
        """
        middles = []
        planes = []
        frames = self._frames
        before = np.zeros((3, len(self._order)), np.int64)  # a chunk can be decoded alone
        self._frames = []
        for V in frames if self.moves else ():
            middle = np.round(V.mean(axis=0), 6)
            steps = quantised((V - middle)[self._order].T, self._place_step)
            planes += [
                residuals(now, last, self._parents) for now, last in zip(steps, before, strict=True)
            ]
            middles.append(middle.tolist())
            before = steps
        return middles, b"".join(planes)


class PageWriter(Writer):
    """Writes a page that plays a run: the player, constant content, and chunks of frames.

    A chunk is written when it is full.
    """

    def __init__(self, source: Source, path: Path) -> None:
        self._source = source
        self._file = path.open("w", encoding="utf-8")
        self._targets = {name: PageTarget(source, name) for name in source.ripples}
        self._with_motion: set[int] = set()  # targets whose mesh for motion is written
        self._poses: list[list[list[float]]] = []
        self._arrows: list[list[list[float]]] = []
        self._planes: list[bytes] = []
        self._frames = 0

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame."""
        if number == 0:
            self._begin(data)
        ripples = self._source.ripples
        pose = self._source.pose(data)
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(pose.rotation).ravel())
        places = np.vstack([[*pose.position, *turn], np.hstack([data.xpos, data.xquat])])
        self._poses.append(np.round(places, 5).tolist())  # of the camera and all bodies
        self._arrows.append([])
        for hit in impulses:
            _, rotation = target_pose(data, ripples.geom_ids[hit.geom])
            normal = ripples[hit.geom].atlas.normals[hit.texel]
            inwards = -rotation @ normal * (-1 if hit.inner else 1)
            # point [m] and inward direction in the world, and impulse [N s]
            arrow = (*hit.point, *inwards, hit.impulse)
            self._arrows[-1].append([round(float(x), 5) for x in arrow])
        self._planes += [
            target.add(ripples.vertices(name, data)) for name, target in self._targets.items()
        ]
        self._frames = number + 1
        if len(self._poses) == _CHUNK:
            self._flush()

    def finish(self) -> None:
        """Complete the page."""
        self._flush()
        self._file.write(
            f'<script type="application/json" id="end">{{"frames": {self._frames}}}</script>\n'
        )
        self._file.write("</body>\n</html>\n")
        self._file.close()

    def _begin(self, data: mujoco.MjData) -> None:
        source = self._source
        model = self._source.model
        targets = set(source.ripples.geom_ids.values())
        floor = find_floor(model, targets)
        left_out = targets if floor is None else targets | {floor}
        parts = [target.part for target in self._targets.values()]
        parts += [_solid_part(solid) for solid in solids(model, left_out, _SEGMENTS)]
        aspect = source.size[0] / source.size[1]
        pose = source.pose(data).in_perspective(aspect, "the page")
        floor_meta = None if floor is None else floor_of(model, floor)
        textured = [part.meta for part in parts] + ([floor_meta] if floor_meta else [])
        images = {}
        for surface in textured:
            texture = surface["texture"]
            if texture >= 0:
                images[texture] = _data_uri(model, texture)
        meta = {
            "fps": source.fps,
            "chunk": _CHUNK,
            "steps": [target.step for target in self._targets.values()],
            "parts": [part.meta for part in parts],
            "images": images,
            "floor": floor_meta,
            "light": light_of(source, data),
            "fovy": pose.fovy,
            "distance": pose.distance,
            "aspect": aspect,
            # of the heights, from the lowest to the highest, sRGB
            "heat": color_table()[::8].tolist(),
        }
        folder = importlib.resources.files(__package__).joinpath("html")
        page = folder.joinpath("page.html").read_text("utf-8")
        scripts = [folder.joinpath(name).read_text("utf-8") for name in _SCRIPTS]
        page = page.replace("TITLE", html.escape(", ".join(self._targets))).replace("MARK", MARK)
        self._file.write(page.replace("SCRIPTS", "\n".join(scripts)))
        arrays = b"".join(array.tobytes() for part in parts for array in part.arrays)
        self._file.write(f'<script type="application/json" id="meta">{json.dumps(meta)}</script>\n')
        self._file.write(f'<script type="text/plain" id="arrays">{packed(arrays)}</script>\n')

    def _flush(self) -> None:
        """Write the frames that wait as a chunk."""
        if not self._poses:
            return
        middles: dict[int, list[list[float]]] = {}  # of the targets that move, by number
        for number, target in enumerate(self._targets.values()):
            places, coded = target.chunk()
            if not target.moves:
                continue
            if number not in self._with_motion:  # before the chunk in which it first moves
                motion = json.dumps(target.motion())
                name = f'class="motion" data-target="{number}"'
                self._file.write(f'<script type="application/json" {name}>{motion}</script>\n')
                self._with_motion.add(number)
            middles[number] = places
            self._planes.append(coded)
        text = json.dumps(
            {"poses": self._poses, "arrows": self._arrows, "middles": middles}
        ).encode()
        content = len(text).to_bytes(4, "little") + text + b"".join(self._planes)
        self._file.write(f'<script type="text/plain" class="chunk">{packed(content)}</script>\n')
        self._file.flush()
        self._poses = []
        self._arrows = []
        self._planes = []
