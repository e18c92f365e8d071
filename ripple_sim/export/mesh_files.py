"""Meshes of one time: a .ply of the rippling surfaces, a .glb of the scene, or a folder of them.

Both are written by trimesh. A folder has a file for each frame.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.exchange.gltf import export_glb
from trimesh.exchange.ply import export_ply
from trimesh.visual.material import PBRMaterial

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft import target_pose
from ripple_sim.encode.replace import MARK, made_here as file_made_here
from ripple_sim.overlay.color_map import colors
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.render.visuals.visual import (
    texture_has_opacity,
    texture_is_half_clear,
    texture_pixels,
    texture_pixels_with_opacity,
)

from .moving_mesh import Displaced, MovingMesh
from .source import Source, Writer
from .visuals import Finish, Solid, solids, target_finish

# glTF has y up and z to the viewer; MuJoCo has z up.
_Y_UP = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])

# Roughness of surfaces with the colours of their heights: highlights would hide the colours.
_HEATMAP_ROUGHNESS = 0.9

_FIRST_LINES_OF_PLY = 2  # "ply" and the format; comments may follow them


class _Surface(NamedTuple):
    """A rippling surface: its mesh, its look, and its places [m, 3, 2] in a flat texture."""

    mesh: MovingMesh
    finish: Finish
    uv: NDArray[np.float64] | None


class MeshWriter(Writer):
    """Writes the latest frame to a .ply or .glb file; see `Writer`."""

    def __init__(self, source: Source, path: Path) -> None:
        self._path = path
        self._frames = _FrameFiles(source, path.suffix.lower())
        self._content = b""

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Replace the previous frame."""
        self._content = self._frames.content(data)

    def finish(self) -> None:
        """Write the file."""
        self._path.write_bytes(self._content)


class MeshFolderWriter(Writer):
    """Writes a folder of .ply or .glb files, one a frame; see `Writer`."""

    def __init__(self, source: Source, path: Path) -> None:
        self._path = path
        self._ending = f".{source.mesh_format}"
        self._frames = _FrameFiles(source, self._ending)
        path.mkdir()

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add the file of a frame."""
        name = f"{self._path.stem}_{number:05d}{self._ending}"
        (self._path / name).write_bytes(self._frames.content(data))

    def finish(self) -> None:
        """Leave the folder as it is."""


class _FrameFiles:
    """Makes the files of frames.

    Parameters
    ----------
    source : Source
    ending : str
        .ply or .glb.
    """

    def __init__(self, source: Source, ending: str) -> None:
        self._source = source
        self._ending = ending
        self._surfaces = {}
        for name in source.ripples:
            mesh = source.mesh(name)
            self._surfaces[name] = _Surface(mesh, *target_finish(source, name, mesh))
        targets = set(source.ripples.geom_ids.values())
        self._solids = solids(source.model, targets) if ending == ".glb" else []

    def content(self, data: mujoco.MjData) -> bytes:
        """The file of a frame."""
        ripples = self._source.ripples
        shapes = {}
        for name, surface in self._surfaces.items():
            waves = ripples[name]
            V = ripples.vertices(name, data)
            shapes[name] = surface.mesh.shape(waves.height, waves.velocity, V)
        if self._ending == ".ply":
            return self._ply(data, shapes)
        return self._glb(data, shapes)

    def _height_colors(self, heights: NDArray[np.float32]) -> NDArray[np.uint8] | None:
        """Colours of heights [m], sRGB uint8 [k, 3]; None if they are not asked for."""
        limit = self._source.height_colors
        if limit is None:
            return None
        if limit == "auto":
            limit = float(np.abs(heights).max(initial=0.0)) or 1.0
        return colors(heights, limit)

    def _ply(self, data: mujoco.MjData, shapes: dict[str, Displaced]) -> bytes:
        """The surfaces in the world as one PLY, with normals and heights."""
        points = []
        normals = []
        triangles = []
        first = 0  # number of the surface's first point
        for name, shape in shapes.items():
            position, rotation = target_pose(data, self._source.ripples.geom_ids[name])
            points.append(shape.points @ rotation.T + position)
            normals.append(shape.normals @ rotation.T)
            triangles.append(self._surfaces[name].mesh.F + first)
            first += len(shape.points)
        heights = np.concatenate([shape.height for shape in shapes.values()])
        mesh = trimesh.Trimesh(
            np.concatenate(points),
            np.concatenate(triangles),
            vertex_normals=np.concatenate(normals),
            vertex_attributes={"height": heights},
            vertex_colors=self._height_colors(heights),
            process=False,
        )
        content = export_ply(mesh, vertex_normal=True)
        lines = content.split(b"\n", _FIRST_LINES_OF_PLY)
        comment = f"comment {MARK}, at {data.time:.6f} s; height is in metres".encode()
        return b"\n".join([*lines[:_FIRST_LINES_OF_PLY], comment, lines[-1]])

    def _glb(self, data: mujoco.MjData, shapes: dict[str, Displaced]) -> bytes:
        """The scene as a binary glTF: a node for each surface, geom and site."""
        scene = trimesh.Scene()
        linear_colors: dict[str, list[float]] = {}
        for name, shape in shapes.items():
            surface = self._surfaces[name]
            geom = self._source.ripples.geom_ids[name]
            heat = self._height_colors(shape.height)
            mesh = _mesh(shape.points, surface.mesh.F, shape.normals, surface.uv)
            mesh.vertex_attributes["_height"] = shape.height[mesh.metadata.pop("vertex")]
            if heat is None:
                is_open = not self._source.ripples[name].rest.mesh.closed
                _paint(mesh, name, surface.finish, self._source.model, linear_colors, is_open)
            else:
                linear_colors[name] = [1.0, 1.0, 1.0, 1.0]
                mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=_linear(heat))
            pose = np.eye(4)
            pose[:3, 3], pose[:3, :3] = target_pose(data, geom)
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=pose)
        for solid in self._solids:
            name = _untaken(solid.name, linear_colors)
            mesh = _mesh(solid.points, solid.F, solid.normals, solid.uv)
            mesh.metadata.pop("vertex")
            _paint(mesh, name, solid.finish, self._source.model, linear_colors)
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=_pose(data, solid))
        scene.apply_transform(_Y_UP)

        def complete(tree: dict[str, Any]) -> None:
            tree["asset"]["generator"] = MARK
            _complete_materials(tree, linear_colors)

        return export_glb(scene, include_normals=True, tree_postprocessor=complete)


def _mesh(
    points: NDArray, F: NDArray[np.int64], normals: NDArray, uv: NDArray[np.float64] | None
) -> trimesh.Trimesh:
    """A mesh with a vertex for each point and each place [m, 3, 2] of it in a texture.

    `metadata["vertex"]` is the point of each vertex.
    """
    vertex = np.arange(len(points))
    places = None
    if uv is not None:
        rows = np.column_stack([F.reshape(-1), uv.reshape(-1, 2)])
        unique, corner = np.unique(rows, axis=0, return_inverse=True)
        F = corner.reshape(-1, 3)
        vertex = unique[:, 0].astype(np.int64)
        places = unique[:, 1:]
    mesh = trimesh.Trimesh(
        points[vertex],
        F,
        vertex_normals=normals[vertex],
        process=False,
        metadata={"vertex": vertex},
    )
    if places is not None:
        mesh.visual = trimesh.visual.TextureVisuals(uv=places)
    return mesh


def _paint(
    mesh: trimesh.Trimesh,
    name: str,
    finish: Finish,
    model: mujoco.MjModel,
    linear_colors: dict[str, list[float]],
    double_sided: bool = False,
) -> None:
    """Give a mesh the material of a finish; note its colour, linear RGBA, by its name."""
    look = finish.look
    opacity = finish.opacity * (1 - look.transparency)
    linear_colors[name] = [*map(float, finish.color), opacity]
    material = PBRMaterial(
        name=name,
        baseColorFactor=linear_colors[name],
        metallicFactor=float(look.metallic),
        roughnessFactor=float(look.roughness),
        doubleSided=double_sided,
        alphaMode="BLEND" if opacity < 1 else "OPAQUE",
    )
    uv = None
    texture = finish.texture
    if texture >= 0:
        uv = mesh.visual.uv
        material.baseColorTexture = Image.fromarray(texture_pixels_with_opacity(model, texture))
        if finish.glow >= 0:
            material.emissiveTexture = Image.fromarray(texture_pixels(model, finish.glow))
            material.emissiveFactor = [1.0, 1.0, 1.0]
        if opacity == 1 and texture_has_opacity(model, texture):
            material.alphaMode = "BLEND" if texture_is_half_clear(model, texture) else "MASK"
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)


def _untaken(name: str, taken: Container[str]) -> str:
    """A name for a node; with a number, if another node has this name already."""
    number = 1
    untaken = name
    while untaken in taken:
        number += 1
        untaken = f"{name}_{number}"
    return untaken


def _complete_materials(tree: dict[str, Any], linear_colors: dict[str, list[float]]) -> None:
    """Give materials their exact colours, and meshes with coloured vertices a material.

    trimesh rounds colours to eight bits, and glTF's material for meshes without one is a metal.
    """
    materials = tree.setdefault("materials", [])
    for material in materials:
        material["pbrMetallicRoughness"]["baseColorFactor"] = linear_colors[material["name"]]
    bare_primitives = []
    for mesh in tree["meshes"]:
        bare_primitives += [part for part in mesh["primitives"] if "material" not in part]
    for primitive in bare_primitives:
        primitive["material"] = len(materials)
    if bare_primitives:
        plain = {"metallicFactor": 0.0, "roughnessFactor": _HEATMAP_ROUGHNESS}
        materials.append({"name": "heights", "pbrMetallicRoughness": plain, "doubleSided": True})


def _linear(heat: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours of vertices as glTF has them, linear, from sRGB."""
    return np.rint(255 * srgb_to_linear(heat / 255.0)).astype(np.uint8)


def _pose(data: mujoco.MjData, solid: Solid) -> NDArray[np.float64]:
    """Where a solid is in the world, [4, 4]."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, solid.quaternion)
    body = data.xmat[solid.body].reshape(3, 3)
    pose = np.eye(4)
    pose[:3, :3] = body @ rotation.reshape(3, 3)
    pose[:3, 3] = body @ solid.position + data.xpos[solid.body]
    return pose


def made_here(path: Path) -> bool:
    """Whether a file was made here, or a folder that has nothing but such files."""
    if path.is_dir():
        files = list(path.iterdir())
        return all(file.suffix in (".ply", ".glb") and made_here(file) for file in files)
    return path.is_file() and file_made_here(path)
