"""Many geoms of one shape in one draw call, as finely tessellated as the frame needs.

The table of objects: one row for each visual and target, to which the samples of the G-buffer refer.

What all visuals of a model share on the GPU.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Balls
from ripple_sim.render.contract import OBJECT, OBJECT_COLUMNS, Unit
from ripple_sim.render.resources import Resources

from .shapes import Shape
from .visual import Look, Textures, Visual

_ROW = OBJECT.dtype


class ObjectTable:
    """Rows of the shaders' `Object`; draw calls write the number of their row."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._rows: list[np.ndarray] = []
        self._texture: moderngl.Texture | None = None

    def add(
        self,
        look: Look,
        geom: int,
        *,
        opacity: float = 1.0,
        size: float = 1.0,
        heatmap: bool = False,
        height_map: int | None = None,
    ) -> int:
        """Append a row and return its number.

        `size` [m] is how thick a transparent object is where its relative thickness is 1; `heatmap` says that colours
        are shown as they are, but for shadows; `height_map` is the layer of the object's height map.
        """
        row = np.zeros((), dtype=_ROW)
        row["base"] = look.roughness, look.metallic, look.sheen, look.coat
        row["volume"] = look.translucency, look.transparency, look.emission, opacity
        row["place"] = geom, size, 0.0, heatmap
        row["height_map"][:2] = (0, 0) if height_map is None else (height_map, 1)
        self._rows.append(row)
        return len(self._rows) - 1

    def set_shadow_bias(self, number: int, bias: float) -> None:
        """Set how far above its surface an object's shadows are looked up [m]: its bumps shall not shade each other."""
        self._rows[number]["place"][2] = bias

    def set_occluders(self, number: int, near: int) -> None:
        """Set which occluders darken an object, as bits; see `Occluders.near`."""
        self._rows[number]["height_map"][2] = near

    def set_chart(self, number: int, side: int) -> None:
        """Set the side of a chart with its halo in an object's height map [texels]."""
        self._rows[number]["height_map"][3] = side

    def set_height_map(self, number: int, bias: float, rotation: NDArray[np.float64]) -> None:
        """Set an object's shadow bias [m], and the rotation of its height map into the world, shape [3, 3]."""
        self.set_shadow_bias(number, bias)
        self._rows[number]["rotation"][:, :3] = rotation.T  # column by column

    def bind(self) -> None:
        """Upload the rows and bind them for the shaders."""
        rows = np.zeros((max(-(-len(self._rows) // OBJECT_COLUMNS), 1), OBJECT_COLUMNS), dtype=_ROW)
        rows.ravel()[: len(self._rows)] = self._rows
        size = rows[0].nbytes // 16, len(rows)
        if self._texture is None or self._texture.size != size:
            self._texture = self._resources.texture(size, 4, dtype="f4")
            self._texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._texture.write(rows.tobytes())
        self._texture.use(Unit.OBJECTS)


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


INSTANCE = np.dtype(
    [
        ("rotation", "f4", (3, 3)),
        ("origin", "f4", 3),
        ("core_size", "f4", 3),
        ("shell_size", "f4", 3),
        ("color", "f4", 4),
        ("mapping", "f4", 4),
        ("tiling", "f4", 4),
    ]
)
_GEOM = mujoco.mjtGeom
_ROUND = (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID, _GEOM.mjGEOM_CAPSULE, _GEOM.mjGEOM_CYLINDER)
_LEVELS = (4, 6, 8, 11, 15, 22)  # segments to a right angle
_BIAS = 3.0  # of shadows, in sagittas of the edges: where light grazes, one is not enough
_FLATNESS = 0.25  # how far the edges of a round shape may be off its surface [pixels]


class ShapeLevels:
    """A shape at several levels of detail, each uploaded at its first use."""

    def __init__(self, resources: Resources, make: Callable[[int], Shape]) -> None:
        self._resources, self._make = resources, make
        self._uploaded: dict[int, tuple[moderngl.Buffer, moderngl.Buffer]] = {}

    def level(self, segments: int) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Vertices (core, shell, normal, texture coordinates) and indices."""
        if segments not in self._uploaded:
            shape = self._make(segments)
            uv = np.zeros((len(shape.core), 2)) if shape.uv is None else shape.uv
            vertices = np.concatenate([shape.core, shape.shell, shape.normals, uv], axis=1)
            self._uploaded[segments] = (
                self._resources.buffer(vertices.astype("f4").tobytes()),
                self._resources.buffer(shape.faces.astype("i4").tobytes()),
            )
        return self._uploaded[segments]


class Instances:
    """Geoms or sites of one shape with one texture.

    Parameters
    ----------
    resources : Resources
    shape : ShapeLevels
    programs : tuple
        For the G-buffer, for depth only, and for the colour alone.
    visuals : list of Visual
        Either geoms or sites.
    records : array of INSTANCE
        `update` fills in the poses.
    image : (Unit, texture), optional

    Attributes
    ----------
    sites : bool
        Whether they are sites.
    numbers : list of int
        In the table of objects.
    balls : Balls
        That contain them.
    shadow_biases : float64 [k]
        How far above the surface shadows must be looked up so that its edges do not shade it [m].
    """

    def __init__(
        self,
        resources: Resources,
        shape: ShapeLevels,
        programs: tuple[moderngl.Program, moderngl.Program, moderngl.Program],
        visuals: list[Visual],
        records: NDArray,
        image: tuple[Unit, moderngl.Texture | moderngl.TextureCube] | None,
    ) -> None:
        self._resources, self._shape, self._programs = resources, shape, programs
        self.sites = visuals[0].site
        self._round = visuals[0].kind in _ROUND
        self._indices = np.array([visual.index for visual in visuals], dtype=np.int64)
        self.numbers = [int(number) for number in records["color"][:, 3]]
        self._records, self._image = records, image
        self._buffer = resources.buffer(reserve=records.nbytes, dynamic=True)
        self._arrays: dict[int, list[moderngl.VertexArray]] = {}
        self._segments = _LEVELS[-1]
        self.shadow_biases = np.zeros(len(visuals))
        self.balls = Balls(np.zeros((len(visuals), 3)), np.zeros(len(visuals)))

    def update(self, data: Any, eye: NDArray[np.float64], pixels: float) -> None:
        """Take the poses from MuJoCo's data; `pixels` is the size of one metre, one metre away from the eye."""
        poses = (data.site_xpos, data.site_xmat) if self.sites else (data.geom_xpos, data.geom_xmat)
        position, rotation = (pose[self._indices] for pose in poses)
        self._records["rotation"] = rotation.reshape(-1, 3, 3).transpose(0, 2, 1)
        self._records["origin"] = position
        self._buffer.write(self._records.tobytes())
        half = self._records["core_size"] + self._records["shell_size"]
        self.balls, radius = Balls(position, np.linalg.norm(half, axis=1)), half.max(axis=1)
        away = np.maximum(np.linalg.norm(position - eye, axis=1) - radius, 0.1 * radius)
        largest = float((radius / away).max()) * pixels
        # the sagitta of a chord over a right angle's nth part: r (1 - cos(pi / 4n))
        needed = np.pi / 4 / np.sqrt(2 * min(_FLATNESS / max(largest, 1e-9), 1.0))
        self._segments = next((n for n in _LEVELS if n >= needed), _LEVELS[-1])
        if self._round:
            self.shadow_biases = _BIAS * radius * (1.0 - np.cos(np.pi / 4 / self._segments))

    def draw(self) -> None:
        """Draw into the G-buffer."""
        if self._image is not None:
            unit, texture = self._image
            texture.use(unit)
        self._array(self._segments)[0].render(instances=len(self._records))

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth only, under a matrix of 16 numbers, column by column."""
        self._programs[1]["matrix"] = view_projection
        self._array(self._segments)[1].render(instances=len(self._records))

    def draw_albedo(self, view_projection: tuple[float, ...]) -> None:
        """Draw coarsely in the linear colour, likewise."""
        self._programs[2]["matrix"] = view_projection
        self._array(_LEVELS[0])[2].render(instances=len(self._records))

    def _array(self, segments: int) -> list[moderngl.VertexArray]:
        if segments not in self._arrays:
            vertices, indices = self._shape.level(segments)
            content = [
                (vertices, "3f 3f 3f 2f", "in_core", "in_shell", "in_normal", "in_uv"),
                (self._buffer, "9f 3f 3f 3f 4f 4f 4f/i", *(f"in_{name}" for name in INSTANCE.names or ())),
            ]
            # what a program does not use is optimised away
            self._arrays[segments] = [
                self._resources.vertex_array(program, content, indices, skip_errors=True) for program in self._programs
            ]
        return self._arrays[segments]
