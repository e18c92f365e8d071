"""Data of all objects for the shaders: their table, textures, and capsules that occlude light."""

from __future__ import annotations

from typing import Any, NamedTuple

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import (
    MAX_OCCLUDERS,
    OBJECT,
    OBJECT_COLUMNS,
    Binding,
    Shading,
    Unit,
)
from ripple_sim.render.resources import Resources
from ripple_sim.render.srgb_textures import srgb_cube, srgb_texture, write_srgb
from ripple_sim.render.tone_mapping import srgb_to_linear

from .scene_entries import outgrown_assets
from .surroundings import horizon_of
from .uploads import WrittenAssets
from .visual import Look, texture_is_half_clear, texture_pixels, texture_pixels_with_opacity

_ROW = OBJECT.dtype

# Texels along a side of a texture, at most, from which its mean colour is taken.
_MAX_MEAN_TEXELS = 2048

# Distance in radii of a capsule above which it hides less than a hundredth of the sky.
_OCCLUSION_REACH = 9.5


class ObjectTable:
    """Rows of the shaders' `Object`; draw calls write the number of their row.

    Attributes
    ----------
    identities : list of (int, int)
        Id and type, of `mujoco.mjtObj`, of what each row shows.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self.identities: list[tuple[int, int]] = []
        self._rows: list[np.ndarray] = []
        self._texture: moderngl.Texture | None = None

    def add(
        self,
        look: Look,
        geom: int,
        *,
        identity: tuple[int, int] = (-1, -1),
        opacity: float = 1.0,
        size: float = 1.0,
        shading: Shading = Shading.USUAL,
        height_map: int | None = None,
        chart: int = 0,
    ) -> int:
        """Append a row and return its number.

        Parameters
        ----------
        geom : int
            See `geoms`.
        identity : (int, int)
            Id and type, of `mujoco.mjtObj`, of the object.
        size : float
            Thickness of a transparent object where its relative thickness is 1 [m].
        shading : Shading
        height_map : int, optional
            Layer of the object's height map.
        chart : int
            Side of a chart with its halo in the height map [texels].
        """
        row = np.zeros((), dtype=_ROW)
        row["volume"][3] = opacity
        row["place"] = geom, size, 0.0, shading
        row["height_map"] = 0 if height_map is None else (height_map, 1, 0, chart)
        self._rows.append(row)
        self.identities.append(identity)
        number = len(self._rows) - 1
        self.paint(number, look)
        return number

    def paint(
        self,
        number: int,
        look: Look,
        opacity: float | None = None,
        shading: Shading | None = None,
    ) -> None:
        """Give a row another look, and another opacity and shading."""
        row = self._rows[number]
        if shading is not None:
            row["place"][3] = shading
        if opacity is not None:
            row["volume"][3] = opacity
        row["base"] = look.roughness, look.metallic, look.sheen, look.coat
        row["volume"][:3] = look.translucency, look.transparency, look.emission

    def place(
        self,
        number: int,
        bias: float,
        *,
        occluders: int = 0,
        rotation: NDArray[np.float64] | None = None,
    ) -> None:
        """Set the values that change from frame to frame.

        Parameters
        ----------
        number : int
            Of the row.
        bias : float
            How far above its surface an object's shadows are looked up [m], so that its bumps do
            not shade each other.
        occluders : int
            Which occluders darken it, as bits; see `Occluders.near`.
        rotation : float64 [3, 3], optional
            Of its height map into the world.
        """
        row = self._rows[number]
        row["place"][2] = bias
        row["height_map"][2] = occluders
        if rotation is not None:
            row["rotation"][:, :3] = rotation.T  # column by column

    @property
    def geoms(self) -> NDArray[np.int64]:
        """Geom of each row, for a site the nearest geom of its body; -1 without a geom."""
        return np.array([row["place"][0] for row in self._rows], dtype=np.int64)

    def keep(self, count: int) -> None:
        """Drop all rows except the first `count`."""
        del self._rows[count:], self.identities[count:]

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


class Skybox(NamedTuple):
    """A skybox on the GPU.

    Attributes
    ----------
    cube : moderngl.TextureCube
    mean : float64 [3]
        Linear colour.
    horizon : moderngl.Texture, optional
        See `horizon_of`.
    """

    cube: moderngl.TextureCube
    mean: NDArray[np.float64]
    horizon: moderngl.Texture | None


class Assets:
    """Textures, shapes and table that all visuals of a model share on the GPU.

    A texture is uploaded at its first use.

    Attributes
    ----------
    objects : ObjectTable
        Every visual and target has a row in it.
    levels : dict
        `Levels` of shapes, by their names.
    version : int
        Number of uploads of changed assets so far.
    reshaped : set of (str, int)
        Kind, "hfield" or "mesh", and id of assets whose shape has changed since the model was
        compiled.
    """

    def __init__(self, model: Any, resources: Resources) -> None:
        self.model = model
        self.resources = resources
        self.objects = ObjectTable(resources)
        self._uploaded: dict[int, moderngl.Texture | moderngl.TextureCube] = {}
        self._mean_colors: dict[int, NDArray[np.float64]] = {}
        self._half_clear: dict[int, bool] = {}
        self.levels: dict[str, Any] = {}
        self.version = 0
        self.reshaped: set[tuple[str, int]] = set()
        self._written: WrittenAssets | None = None

    def watch(self) -> None:
        """From now on upload assets that a program writes into the model, at each `refresh`."""
        self._written = WrittenAssets(self.model)
        self.reshaped |= outgrown_assets(self.model)

    def refresh(self) -> None:
        """Upload assets that a program has written since the last call, if `watch` was called."""
        if self._written is not None:
            for kind, index in sorted(self._written.look()):
                self.upload(kind, index)

    def upload(self, kind: str, index: int) -> None:
        """Upload a "texture", "hfield" or "mesh" of the model again, if it was uploaded before."""
        self.version += 1
        if kind == "texture":
            self._mean_colors.pop(index, None)
            self._half_clear.pop(index, None)
            if index in self._uploaded:
                pixels = texture_pixels_with_opacity(self.model, index)
                write_srgb(self.resources, self._uploaded[index], pixels)
            return
        self.reshaped.add((kind, index))
        for name in (f"{kind} {index}", f"hull {index}" if kind == "mesh" else ""):
            if name in self.levels:
                self.levels[name].renew()

    def texture(self, texture: int) -> moderngl.Texture | moderngl.TextureCube:
        """Return the texture of an id; it reads as linear light."""
        if texture not in self._uploaded:
            pixels = texture_pixels_with_opacity(self.model, texture)
            flat = self.model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
            self._uploaded[texture] = (srgb_texture if flat else srgb_cube)(self.resources, pixels)
        return self._uploaded[texture]

    def mean_color(self, texture: int) -> NDArray[np.float64]:
        """Mean linear colour [3] of the texture of an id."""
        if texture not in self._mean_colors:
            pixels = texture_pixels(self.model, texture)
            # all texels of a large texture would be gigabytes of numbers
            step = -(-max(pixels.shape) // _MAX_MEAN_TEXELS)
            linear = srgb_to_linear(pixels[::step, ::step] / 255.0)
            self._mean_colors[texture] = linear.mean(axis=(0, 1))
        return self._mean_colors[texture]

    def is_half_clear(self, texture: int) -> bool:
        """Whether the texture of an id has texels that are neither opaque nor clear."""
        if texture not in self._half_clear:
            self._half_clear[texture] = texture_is_half_clear(self.model, texture)
        return self._half_clear[texture]

    def skybox(self) -> Skybox | None:
        """Return the model's skybox, or None."""
        for texture in range(self.model.ntex):
            if self.model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                pixels = texture_pixels(self.model, texture)
                self._uploaded[texture] = cube = srgb_cube(self.resources, pixels)
                mean = srgb_to_linear(pixels[::4, ::4] / 255.0).mean(axis=(0, 1))
                return Skybox(cube, mean, self._horizon(pixels))
        return None

    def _horizon(self, pixels: NDArray[np.uint8]) -> moderngl.Texture | None:
        colors = horizon_of(pixels)
        if colors is None:
            return None
        texels = np.column_stack([colors, np.ones(len(colors))]).astype("f2")
        texture = self.resources.texture((len(colors), 1), 4, texels.tobytes(), dtype="f2")
        texture.filter = moderngl.LINEAR, moderngl.LINEAR
        return texture


class Occluders:
    """Capsules, each about as large as a geom, that hide the sky from objects near them.

    Parameters
    ----------
    model : mujoco.MjModel
    geoms : int64 [k]
    """

    def __init__(self, resources: Resources, model: Any, geoms: NDArray[np.int64]) -> None:
        self._model = model
        self._buffer = resources.buffer(reserve=32 * MAX_OCCLUDERS, dynamic=True)
        self._bound = np.zeros((0, 2, 4))
        self._bound_geoms = np.zeros(0, np.int64)
        self.hold(geoms)

    def hold(self, geoms: NDArray[np.int64], boxes: NDArray[np.float64] | None = None) -> None:
        """Have capsules of these geoms [k] from now on.

        `boxes` [k, 6] [m] are centres and half sizes of their bounding boxes, by default the
        model's.
        """
        boxes = self._model.geom_aabb[geoms] if boxes is None else boxes
        self._geoms = geoms
        half = boxes[:, 3:]
        # a capsule lies along its geom's longest axis
        across = np.arange(3) != half.argmax(axis=1)[:, None]
        self._centre = boxes[:, :3]
        self._bounds = np.linalg.norm(half, axis=1)
        self._radius = np.sqrt(np.prod(half, axis=1, where=across))
        self._half_axis = np.where(across, 0.0, np.maximum(half - self._radius[:, None], 0.0))

    def balls(self, data: Any) -> NDArray[np.float64]:
        """Bounding balls of the geoms."""
        return np.column_stack([self._middles(data)[1], self._bounds])

    def bind(self, data: Any, focus: NDArray[np.float64]) -> None:
        """Bind the capsules nearest to a point [m]."""
        rotation, middle = self._middles(data)
        axis = np.einsum("gij,gj->gi", rotation, self._half_axis)
        away = np.linalg.norm(middle - focus, axis=1)
        nearest = np.argsort(away, kind="stable")
        # capsules fade out before they leave the list
        limit = away[nearest[MAX_OCCLUDERS]] if len(nearest) > MAX_OCCLUDERS else np.inf
        nearest = nearest[:MAX_OCCLUDERS]
        fade = np.clip(4 * (1 - away[nearest] / limit), 0.0, 1.0)
        packed = np.zeros((len(nearest), 2, 4), dtype=np.float32)
        packed[:, 0, :3] = (middle - axis)[nearest]
        packed[:, 1, :3] = (middle + axis)[nearest]
        packed[:, 0, 3] = self._radius[nearest] * fade
        self._buffer.write(packed.tobytes())
        self._buffer.bind_to_uniform_block(Binding.OCCLUDERS)
        self._bound = packed.astype(np.float64)
        self._bound_geoms = self._geoms[nearest]

    def near(self, balls: NDArray[np.float64], geoms: NDArray[np.int64]) -> NDArray[np.int64]:
        """Bits of the bound capsules that darken objects by a hundredth or more.

        The capsule of an object's own geom is left out.

        Parameters
        ----------
        balls : float64 [k, 4]
            Balls that contain the objects [m].
        geoms : int64 [k]
            Geoms of the objects.
        """
        first = self._bound[:, 0, :3]
        last = self._bound[:, 1, :3]
        radius = self._bound[:, 0, 3]
        axis = last - first
        to = balls[:, None, :3] - first
        square_length = np.maximum(np.einsum("ej,ej->e", axis, axis), 1e-12)
        along = np.einsum("ej,kej->ke", axis, to) / square_length
        away = np.linalg.norm(to - np.clip(along, 0, 1)[..., None] * axis, axis=2) - balls[:, 3:]
        counts = (away < _OCCLUSION_REACH * radius) & (geoms[:, None] != self._bound_geoms)
        return (counts << np.arange(len(radius))).sum(axis=1)

    def _middles(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotations [k, 3, 3] of the geoms, and middles [k, 3] of their boxes [m], in the world."""
        rotation = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        middle = data.geom_xpos[self._geoms] + np.einsum("gij,gj->gi", rotation, self._centre)
        return rotation, middle
