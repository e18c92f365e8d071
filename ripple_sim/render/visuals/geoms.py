"""The geoms of a MuJoCo model other than its floor and its targets, and its sites, on the GPU.

Many of one shape are one draw call, as finely tessellated as the frame needs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import GeomId
from ripple_sim.render.contract import CasterMap, Shading
from ripple_sim.render.pose import Pose
from ripple_sim.render.resources import Resources

from .objects import Assets, Occluders
from .shapes import NamedShape, Shape, facing_lines, shape_of, sizes
from .texture_mapping import TextureMapping, mapping_of
from .visual import Visual, ball_of, geom_visual, host_of, look_of, site_visual, visible_sites

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
_SHEETS = (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_TRIANGLE, _GEOM.mjGEOM_LINE)
# Kinds that have as many segments as the frame needs; other kinds always have the same mesh.
_WITH_LEVELS = (
    *_ROUND,
    _GEOM.mjGEOM_BOX,
    _GEOM.mjGEOM_ARROW,
    _GEOM.mjGEOM_ARROW1,
    _GEOM.mjGEOM_ARROW2,
)

# Segments to a right angle, from coarse to fine: in colours, and where shapes are measured, in
# depth and segmentation.
_LEVELS = (4, 6, 8, 11, 15, 22)
_MEASURED_LEVELS = (*_LEVELS, 2 * _LEVELS[-1])

# Bias of shadows, in sagittas of the edges: where light grazes, one sagitta is not enough.
_SHADOW_BIAS = 3.0

_SHARP_BEVEL = 1e-6  # of sharp edges, in half sizes: their normals need some

# How far the edges of a round shape may be off its surface [pixels]: in colours, and where shapes
# are measured. Measured depths are off by as much of a pixel's width; they are off by more only
# where a surface is seen at a slant.
_FLATNESS = 0.25
_MEASURED_FLATNESS = 1 / 64


class Levels:
    """Buffers of a shape at several levels of detail, each uploaded at its first use.

    Parameters
    ----------
    make : callable
        Makes the shape with so many segments to a right angle.
    """

    def __init__(self, resources: Resources, make: Callable[[int], Shape]) -> None:
        self._resources = resources
        self._make = make
        self._levels: dict[int, tuple[moderngl.Buffer, moderngl.Buffer, int]] = {}

    def __call__(self, segments: int) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Vertices (core, shell, normal, texture coordinates) and indices."""
        if segments not in self._levels:
            vertices, indices = _packed(self._make(segments))
            buffers = self._resources.buffer(vertices), self._resources.buffer(indices)
            self._levels[segments] = *buffers, len(indices) // 4
        return self._levels[segments][:2]

    def count(self, segments: int) -> int:
        """How many indices there are."""
        return self._levels[segments][2]

    def renew(self, make: Callable[[int], Shape] | None = None) -> None:
        """Make the shape again, in the same buffers; with `make` from now on, if it is given."""
        self._make = make or self._make
        for segments, (vertices, indices, _) in self._levels.items():
            contents = _packed(self._make(segments))
            for buffer, content in zip((vertices, indices), contents, strict=True):
                buffer.orphan(len(content))
                buffer.write(content)
            self._levels[segments] = vertices, indices, len(contents[1]) // 4


def _packed(shape: Shape) -> tuple[bytes, bytes]:
    """Vertices and indices as `Levels` has them."""
    uv = np.zeros((len(shape.core), 2)) if shape.uv is None else shape.uv
    vertices = np.concatenate([shape.core, shape.shell, shape.normals, uv], axis=1)
    return vertices.astype("f4").tobytes(), shape.faces.astype("i4").tobytes()


class Instances:
    """Visuals of one shape with one texture, or a single transparent visual: one draw call.

    Parameters
    ----------
    programs : mapping of moderngl.Program
        By map; the program of None is for the G-buffer.
    members : list of (Visual, int)
        Either geoms, or sites, or other visuals, each with its number in the table of objects; see
        `hold`.

    Attributes
    ----------
    numbers : list of int
        In the table of objects.
    transparent : bool
        Whether the scene behind shows through.
    blocks : bool
        Whether no light passes.
    is_plane : bool
    is_sheet : bool
        Whether it has no inside, and is seen from both sides.
    occludes : bool
        Whether it hides the sky from things below: opaque geoms do.
    casts : bool
        Whether it casts shadows: entries that MuJoCo adds to explain a scene do not.
    shadow_biases : float64 [k]
        How far above the surface shadows must be looked up so that its edges do not shade it [m].
    """

    def __init__(
        self,
        assets: Assets,
        level: Levels,
        programs: Mapping[CasterMap | None, moderngl.Program],
        members: list[tuple[Visual, int]],
    ) -> None:
        self._assets = assets
        self._level = level
        self._programs = programs
        self._buffer = assets.resources.buffer(
            reserve=INSTANCE.itemsize * len(members), dynamic=True
        )
        self._level_buffers: dict[int, moderngl.Buffer] = {}
        self._arrays: dict[tuple[CasterMap | None, int, moderngl.Buffer], moderngl.VertexArray] = {}
        self._segments = _LEVELS[-1]
        self.hold(members)

    def hold(self, members: list[tuple[Visual, int]]) -> None:
        """Draw these members from now on; shape and texture are the same as before."""
        model = self._assets.model
        self._visual = members[0][0]
        self.numbers = [number for _, number in members]
        self.transparent = self._visual.opacity < 1.0
        self.blocks = self._visual.passes == 0.0
        self.is_plane = self._visual.kind == _GEOM.mjGEOM_PLANE
        self.is_sheet = self._visual.kind in _SHEETS
        self.occludes = self.blocks and not (self._visual.site or self._visual.pose)
        self.casts = self._visual.casts
        self._indices = np.array([visual.index for visual, _ in members], dtype=np.int64)
        self._hosts = np.array([host_of(model, visual) for visual, _ in members])
        self._poses = [visual.pose for visual, _ in members if visual.pose is not None]
        self._records = np.zeros(len(members), dtype=INSTANCE)
        for record, (visual, number) in zip(self._records, members, strict=True):
            mapping = mapping_of(model, visual)
            record["color"] = [*visual.color, number]
            record["mapping"] = [*mapping.scale, mapping.stretch * mapping.scale[2]]
            record["tiling"] = mapping.tiling
        # core and shell size of each member, [k, 2, 3], with round edges and with sharp ones
        self._round_sizes = np.array([sizes(model, visual) for visual, _ in members])
        self._sharp_sizes = np.array([sizes(model, visual, _SHARP_BEVEL) for visual, _ in members])
        self._unit = mapping.unit
        self._image = None if mapping.texture < 0 else self._assets.texture(mapping.texture)
        if self._buffer.size < self._records.nbytes:
            self._buffer.orphan(2 * self._records.nbytes)
        if self._visual.corners is not None:  # its shape changes with every frame
            shape = shape_of(model, self._visual)
            if shape is not None:
                _, make = shape
                self._level.renew(make)
        self.shadow_biases = np.zeros(len(members))

    def update(
        self, data: Any, pose: Pose, height: int, occluders: Occluders, sharp: bool = False
    ) -> None:
        """Take the poses from MuJoCo's data, and choose the level of detail.

        The members are seen from `pose` in frames of a height [pixels]. With `sharp` edges are as
        in MuJoCo, and each round member has its own level.
        """
        position, rotation = self._places(data)
        rotation = rotation.reshape(-1, 3, 3)
        member_sizes = self._sharp_sizes if sharp else self._round_sizes
        if self._visual.kind == _GEOM.mjGEOM_LINE:
            rotation, member_sizes = facing_lines(member_sizes, position, rotation, pose, height)
        self._records["rotation"] = rotation.transpose(0, 2, 1)
        self._records["origin"] = position
        self._records["core_size"] = member_sizes[:, 0]
        self._records["shell_size"] = member_sizes[:, 1]
        self._buffer.write(self._records.tobytes())
        half = self._records["core_size"] + self._records["shell_size"]
        balls = np.column_stack([position, np.linalg.norm(half, axis=1)])
        radius = half.max(axis=1)  # [m]
        to_middle = np.linalg.norm(position - pose.position, axis=1)
        to_surface = np.maximum(to_middle - radius, 0.1 * radius)
        nearest = np.ones_like(radius) if pose.orthographic else to_surface
        pixels = radius / nearest / pose.pixel_height(1.0, height)
        self._segments = int(_segments(pixels.max(), _FLATNESS, _LEVELS))
        self._draws = [(self._segments, self._buffer, len(self._records))]
        if sharp and self._visual.kind in _WITH_LEVELS:
            self._draws = self._by_level(_segments(pixels, _MEASURED_FLATNESS, _MEASURED_LEVELS))
        if self._visual.kind in _ROUND:
            self.shadow_biases = _SHADOW_BIAS * radius * (1.0 - np.cos(np.pi / 4 / self._segments))
        near = occluders.near(balls, self._hosts)
        for number, bias, bits in zip(self.numbers, self.shadow_biases, near, strict=True):
            self._assets.objects.place(number, float(bias), occluders=int(bits))

    def _places(self, data: Any) -> tuple[NDArray, NDArray]:
        """Positions [k, 3] [m] and rotations, 9 numbers for each member."""
        if self._poses:
            position = np.array([position for position, _ in self._poses])
            rotation = np.array([rotation for _, rotation in self._poses])
            return position, rotation
        if self._visual.site:
            return data.site_xpos[self._indices], data.site_xmat[self._indices]
        return data.geom_xpos[self._indices], data.geom_xmat[self._indices]

    def _by_level(self, segments: NDArray[np.int64]) -> list[tuple[int, moderngl.Buffer, int]]:
        """Draw calls of the members by their segments [k].

        A draw call consists of the segments, a buffer of members, and the number of members.
        """
        levels = np.unique(segments).tolist()
        if len(levels) == 1:
            return [(levels[0], self._buffer, len(self._records))]
        draws = []
        for level in levels:
            records = self._records[segments == level]
            if level not in self._level_buffers:
                self._level_buffers[level] = self._assets.resources.buffer(
                    reserve=records.nbytes, dynamic=True
                )
            buffer = self._level_buffers[level]
            if buffer.size < records.nbytes:
                buffer.orphan(2 * records.nbytes)
            buffer.write(records.tobytes())
            draws.append((level, buffer, len(records)))
        return draws

    def bounds(self, data: Any) -> NDArray[np.float64]:
        """Bounding ball [1, 4] of the first member, where it is in MuJoCo's data.

        A transparent member is the only one.
        """
        return ball_of(self._assets.model, data, self._visual)

    def draw(self) -> None:
        """Draw into the G-buffer."""
        if self._image is not None:
            self._image.use(self._unit)
        for draw in self._draws:
            self._render(None, *draw)

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw into a map of a light or, coarsely, of the floor; see `DrawnScene.cast`."""
        if seen == CasterMap.TRANSMISSION:
            uniforms["transmission"] = (self._visual.passes,) * 3
        for name, value in uniforms.items():
            self._programs[seen][name] = value
        segments = _LEVELS[0] if seen == CasterMap.ALBEDO else self._segments
        self._render(seen, segments, self._buffer, len(self._records))

    def _render(
        self, seen: CasterMap | None, segments: int, members: moderngl.Buffer, count: int
    ) -> None:
        """Render `count` members, whose records are in the buffer `members`."""
        segments = segments if self._visual.kind in _WITH_LEVELS else 0
        if (seen, segments, members) not in self._arrays:
            vertices, indices = self._level(segments)
            content = [
                (vertices, "3f 3f 3f 2f", "in_core", "in_shell", "in_normal", "in_uv"),
                (
                    members,
                    "9f 3f 3f 3f 4f 4f 4f/i",
                    *(f"in_{name}" for name in INSTANCE.names or ()),
                ),
            ]
            # inputs that a program does not use are optimised away
            self._arrays[seen, segments, members] = self._assets.resources.vertex_array(
                self._programs[seen], content, indices, skip_errors=True
            )
        with self._assets.resources.gl as ctx:
            if self.is_sheet:
                ctx.disable(moderngl.CULL_FACE)
            self._arrays[seen, segments, members].render(
                vertices=self._level.count(segments), instances=count
            )
            if self.is_sheet:
                ctx.enable(moderngl.CULL_FACE)


def _segments(
    radius: NDArray[np.float64], flatness: float, levels: tuple[int, ...]
) -> NDArray[np.int64]:
    """The coarsest level, in segments to a right angle, that is flat enough; else the finest level.

    Edges of circles of a radius [pixels] may be off by `flatness` [pixels]. The sagitta of a chord
    over a right angle's nth part is r (1 - cos(pi / 4n)).
    """
    needed = np.pi / 4 / np.sqrt(2 * np.minimum(flatness / np.maximum(radius, 1e-9), 1.0))
    return np.array(levels)[np.minimum(np.searchsorted(levels, needed), len(levels) - 1)]


def _shading_of(visual: Visual) -> Shading:
    """Shading of a visual, as in MuJoCo."""
    if visual.kind == _GEOM.mjGEOM_LINE:
        return Shading.UNLIT
    if visual.behind or visual.kind == _GEOM.mjGEOM_TRIANGLE:
        return Shading.BACK_AS_FRONT
    return Shading.USUAL


def visuals_of(model: Any, geoms: Iterable[GeomId]) -> list[tuple[Visual, NamedShape]]:
    """The given geoms of a model and its visible sites that have a shape, each with its shape."""
    visuals = [geom_visual(model, geom) for geom in geoms]
    visuals += [site_visual(model, site) for site in visible_sites(model)]
    return shaped(model, visuals)


def shaped(model: Any, visuals: Iterable[Visual]) -> list[tuple[Visual, NamedShape]]:
    """The visuals that have a shape, each with its shape."""
    result = []
    for visual in visuals:
        shape = shape_of(model, visual)
        if shape is not None:
            result.append((visual, shape))
    return result


def instances_of(
    assets: Assets,
    visuals: list[tuple[Visual, NamedShape]],
    made: dict[tuple[Any, ...], Instances] | None = None,
) -> list[Instances]:
    """Draw calls of visuals: one for each shape and texture, and one for each transparent visual.

    Draw calls in `made` are used again, for the new visuals; new draw calls are added to it.
    """
    model = assets.model
    resources = assets.resources
    made = {} if made is None else made
    groups: dict[tuple[Any, ...], tuple[NamedShape, TextureMapping, list[tuple[Visual, int]]]] = {}
    for index, (visual, shape) in enumerate(visuals):
        mapping = mapping_of(model, visual)
        look = look_of(model, visual)
        host = host_of(model, visual)
        number = assets.objects.add(
            look,
            host,
            opacity=visual.opacity,
            identity=visual.identity,
            shading=_shading_of(visual),
        )
        name, _ = shape
        key = (
            visual.site,
            visual.pose is not None,
            visual.casts,
            name,
            mapping.kind,
            mapping.texture,
            index if visual.opacity < 1.0 else None,
        )
        _, _, members = groups.setdefault(key, (shape, mapping, []))
        members.append((visual, number))

    @functools.cache
    def program(kind: int, own: bool) -> moderngl.Program:
        return resources.program("visuals/geom", MAPPING=kind, OWN=int(own))

    casters: dict[CasterMap | None, moderngl.Program] = {
        seen: resources.program("passes/casters", MOVED=0, MAP=seen) for seen in CasterMap
    }
    for key, ((name, make), mapping, members) in groups.items():
        if key in made:
            made[key].hold(members)
        else:
            level = assets.levels.setdefault(name, Levels(resources, make))
            programs = casters | {None: program(mapping.kind, mapping.own)}
            made[key] = Instances(assets, level, programs, members)
    return [made[key] for key in groups]
