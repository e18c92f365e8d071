"""Many geoms of one shape in one draw call, as finely cut as the picture needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.resources import OwnedObjects

from .primitives import Shape
from .texture_mapping import Mapping
from .visual import Piece

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
_CLEARANCE = 3.0  # of shadows above the edges, in their sagitta: where light grazes, one is not enough
_FLATNESS = 0.25  # how far the edges of a round shape may stand off its surface [pixels]


class ShapeLevels:
    """A shape at several levels of detail, each uploaded at its first use."""

    def __init__(self, ctx: OwnedObjects, make: Callable[[int], Shape]) -> None:
        self._ctx, self._make = ctx, make
        self._made: dict[int, tuple[moderngl.Buffer, moderngl.Buffer]] = {}

    def level(self, segments: int) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Vertices (core, shell, normal, texture coordinates) and indices."""
        if segments not in self._made:
            shape = self._make(segments)
            uv = np.zeros((len(shape.core), 2)) if shape.uv is None else shape.uv
            vertices = np.concatenate([shape.core, shape.shell, shape.normals, uv], axis=1)
            self._made[segments] = (
                self._ctx.buffer(vertices.astype("f4").tobytes()),
                self._ctx.buffer(shape.faces.astype("i4").tobytes()),
            )
        return self._made[segments]


class Instances:
    """Geoms or sites of one shape with one texture.

    Parameters
    ----------
    ctx : OwnedObjects
    shape : ShapeLevels
    programs : tuple
        For the geometry pass and for depth alone.
    pieces : list of Piece
        Either geoms or sites.
    records : array of INSTANCE
        What does not change; poses are filled in by `update`.
    mapping : Mapping
    texture : texture, optional

    Attributes
    ----------
    sites : bool
        Whether they are sites.
    numbers : list of int
        In the table of objects.
    lifts : float array
        How far above each one's surface shadows must be looked up so that its edges do not shade it [m].
    """

    def __init__(
        self,
        ctx: OwnedObjects,
        shape: ShapeLevels,
        programs: tuple[moderngl.Program, moderngl.Program],
        pieces: list[Piece],
        records: NDArray,
        mapping: Mapping,
        texture: moderngl.Texture | moderngl.TextureCube | None,
    ) -> None:
        self._ctx, self._shape, self._programs = ctx, shape, programs
        self.sites = pieces[0].site
        self._round = pieces[0].kind in _ROUND
        self._indices = np.array([piece.index for piece in pieces], dtype=np.int64)
        self.numbers = [int(number) for number in records["color"][:, 3]]
        self._records, self._mapping, self._texture = records, mapping, texture
        self._buffer = ctx.buffer(reserve=records.nbytes, dynamic=True)
        self._arrays: dict[int, tuple[moderngl.VertexArray, moderngl.VertexArray]] = {}
        self._segments = _LEVELS[-1]
        self.lifts = np.zeros(len(pieces))

    def update(self, data: Any, eye: NDArray[np.float64], pixels: float) -> None:
        """Take the poses from MuJoCo's data; `pixels` is the size of one metre, one metre away from the eye."""
        poses = (data.site_xpos, data.site_xmat) if self.sites else (data.geom_xpos, data.geom_xmat)
        position, rotation = (pose[self._indices] for pose in poses)
        self._records["rotation"] = rotation.reshape(-1, 3, 3).transpose(0, 2, 1)
        self._records["origin"] = position
        self._buffer.write(self._records.tobytes())
        radius = (self._records["core_size"] + self._records["shell_size"]).max(axis=1)
        away = np.maximum(np.linalg.norm(position - eye, axis=1) - radius, 0.1 * radius)
        largest = float((radius / away).max()) * pixels
        # the sagitta of a chord over a right angle's nth part: r (1 - cos(pi / 4n))
        needed = np.pi / 4 / np.sqrt(2 * min(_FLATNESS / max(largest, 1e-9), 1.0))
        self._segments = next((n for n in _LEVELS if n >= needed), _LEVELS[-1])
        if self._round:
            self.lifts = _CLEARANCE * radius * (1.0 - np.cos(np.pi / 4 / self._segments))

    def draw(self) -> None:
        """Draw into the geometry pass."""
        if self._texture is not None:
            self._texture.use(self._mapping.unit)
        self._array()[0].render(instances=len(self._records))

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth alone, under a matrix of 16 numbers, column by column."""
        self._programs[1]["view_projection"] = view_projection
        self._array()[1].render(instances=len(self._records))

    def _array(self) -> tuple[moderngl.VertexArray, moderngl.VertexArray]:
        if self._segments not in self._arrays:
            vertices, indices = self._shape.level(self._segments)
            content = [
                (vertices, "3f 3f 3f 2f", "in_core", "in_shell", "in_normal", "in_uv"),
                (self._buffer, "9f 3f 3f 3f 4f 4f 4f/i", *(f"in_{name}" for name in INSTANCE.names or ())),
            ]
            # programs that do not use all of them have them optimised away
            first, second = (
                self._ctx.vertex_array(program, content, indices, skip_errors=True) for program in self._programs
            )
            self._arrays[self._segments] = first, second
        return self._arrays[self._segments]
