"""The colours of mesh files on targets, as one texture each of their model."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh, load_mesh
from ripple_sim.solver.mesh.looks import OPAQUE, ImageSource, Looks, Paint

from .material_images import MaterialImages, load_image
from .packing import packed

# Geoms that have meshes, and the endings of files that MuJoCo reads and that have materials.
_MESH_TYPES = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
_FILE_ENDINGS = (".obj", ".stl")

# Colour of a geom where the MJCF gives none.
_PLAIN_RGBA = (0.5, 0.5, 0.5, 1.0)

# Endings of the image NAME_texture beside a mesh file.
_IMAGE_ENDINGS = (".png", ".jpg", ".jpeg")

# Images that are scaled by less than this are noted.
_NOTED_SCALE = 0.7


@dataclasses.dataclass(frozen=True)
class Painting:
    """What a target's material needs.

    Attributes
    ----------
    pixels : uint8 [height, width, 3 or 4]
        sRGB, and opacity if the surface is not opaque everywhere.
    uv : float64 [triangle_count, 3, 2]
        Texture coordinates of the corners; v is counted from the upper edge.
    metallic, roughness : float or None
        Means over the surface.
    notes : tuple of str
        What is not shown, one line each.
    glow : uint8 [height, width, 3] or None
        sRGB of the light that the surface emits, likewise.
    """

    pixels: NDArray[np.uint8]
    uv: NDArray[np.float64]
    metallic: float | None = None
    roughness: float | None = None
    notes: tuple[str, ...] = ()
    glow: NDArray[np.uint8] | None = None


def paint_target(
    spec: mujoco.MjSpec, mesh: Mesh, mesh_path: str | Path, texture: str | Path | None
) -> tuple[str, ...]:
    """Give the geom "target" its colours, and return what of them is not shown, one line each.

    They are those of the image that is asked for, of the materials of the mesh, or of the image
    NAME_texture.png beside the file.

    Raises `SceneError` if an image that is asked for cannot be read, or the mesh has no texture
    coordinates.
    """
    looks = mesh.looks
    if texture is not None:
        painting = _of_image(mesh, mesh_path, texture)
    else:
        if mesh.corner_uv is not None and not _has_image(looks):
            looks = _looks_beside(Path(mesh_path), len(mesh.F)) or looks
        if looks is None:
            return ()
        if not looks.paints:
            return looks.notes
        painting = painting_of(mesh, looks)
    _give(spec, spec.geom("target"), painting, "target")
    return painting.notes


def paint_from_files(spec: mujoco.MjSpec, names: Sequence[str]) -> tuple[str, ...]:
    """Give mesh geoms the materials of their files; return what is not shown, one line each.

    The MJCF says more than the file: a geom with a material or a colour keeps it, and so does a
    mesh with texture coordinates of the MJCF.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place.
    names : sequence of str
        Of geoms; names of anything else are left alone.
    """
    notes: list[str] = []
    for name in names:
        geom = spec.geom(name)
        asset = None if geom is None or geom.type not in _MESH_TYPES else spec.mesh(geom.meshname)
        if asset is None or geom.material or len(asset.usertexcoord):
            continue
        path = Path(spec.modelfiledir) / spec.meshdir / asset.file
        if not np.array_equal(geom.rgba, _PLAIN_RGBA) or path.suffix.lower() not in _FILE_ENDINGS:
            continue
        mesh = load_mesh(path)
        if mesh.looks is None or not mesh.looks.paints:
            notes += () if mesh.looks is None else mesh.looks.notes
            continue
        painting = painting_of(mesh, mesh.looks)
        # the triangles to which the looks belong; scale and position of the asset stay
        asset.file = ""
        asset.uservert = mesh.V.ravel()
        asset.userface = mesh.F.ravel()
        _give(spec, geom, painting, f"{name}: materials of {path.name}")
        notes += painting.notes
    return tuple(notes)


def _give(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, painting: Painting, name: str) -> None:
    """Give a mesh geom a material of some name, and its mesh the texture coordinates."""
    asset = spec.mesh(geom.meshname)
    asset.usertexcoord = painting.uv.ravel()
    asset.userfacetexcoord = np.arange(painting.uv.size // 2)
    _add_texture(spec, name, painting.pixels)
    material = spec.add_material(name=name)
    has_opacity = painting.pixels.shape[2] == 4
    role = mujoco.mjtTextureRole
    material.textures[role.mjTEXROLE_RGBA if has_opacity else role.mjTEXROLE_RGB] = name
    if painting.glow is not None:
        _add_texture(spec, f"{name}: emission", painting.glow)
        material.textures[role.mjTEXROLE_EMISSIVE] = f"{name}: emission"
    if painting.metallic is not None:
        material.metallic = painting.metallic
    if painting.roughness is not None:
        material.roughness = painting.roughness
    geom.material = name


def _add_texture(spec: mujoco.MjSpec, name: str, pixels: NDArray[np.uint8]) -> None:
    height, width, channels = pixels.shape
    texture = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        height=height,
        width=width,
        nchannel=channels,
    )
    texture.data = pixels.tobytes()


def _of_image(mesh: Mesh, mesh_path: str | Path, texture: str | Path) -> Painting:
    """The image that is asked for, in the mesh's own texture coordinates."""
    if mesh.corner_uv is None:
        raise SceneError(
            f"texture {str(texture)!r} cannot be shown on {str(mesh_path)!r}, which has no "
            "texture coordinates: choose a mesh that has them (a wrap has none)"
        )
    return Painting(load_image(texture), mesh.corner_uv * [1.0, -1.0] + [0.0, 1.0])


def painting_of(mesh: Mesh, looks: Looks) -> Painting:
    """The looks of a mesh, which have materials, packed into one image."""
    images = MaterialImages()
    image = packed(looks, mesh.corner_uv, images.of)
    has_opacity = any(paint.alpha != OPAQUE for paint in looks.paints)
    has_opacity = has_opacity and bool((image.pixels[..., 3] < 255).any())
    pixels = image.pixels if has_opacity else np.ascontiguousarray(image.pixels[..., :3])
    metallic, roughness = _mean_gloss(mesh, looks, images)
    notes = (*looks.notes, *images.notes())
    if image.scale < _NOTED_SCALE:
        notes = (*notes, f"its images are scaled to {image.scale:.0%} to fit into one texture")
    glow = image.glow if image.glow is not None and image.glow.any() else None
    return Painting(pixels, image.uv, metallic, roughness, notes, glow)


def _mean_gloss(
    mesh: Mesh, looks: Looks, images: MaterialImages
) -> tuple[float | None, float | None]:
    """Metallic and roughness of the materials, weighted by area; None where none has any."""
    areas = np.bincount(looks.paint, weights=mesh.triangle_areas, minlength=len(looks.paints))
    metallic = []
    roughness = []
    for paint, area in zip(looks.paints, areas.tolist(), strict=True):
        if area <= 0:
            continue
        metal_factor, rough_factor = images.gloss(paint)
        if paint.metallic is not None:
            metallic.append((area, metal_factor * paint.metallic))
        if paint.roughness is not None:
            roughness.append((area, rough_factor * paint.roughness))
    return _mean(metallic), _mean(roughness)


def _mean(weighted: list[tuple[float, float]]) -> float | None:
    """Mean of values with their weights, from 0 to 1; None without any."""
    if not weighted:
        return None
    weights, values = np.array(weighted).T
    return float(np.clip(np.average(values, weights=weights), 0.0, 1.0))


def _has_image(looks: Looks | None) -> bool:
    """Whether a material has an image."""
    if looks is None or not looks.paints:
        return False
    return any(looks.paints[number].image is not None for number in np.unique(looks.paint))


def _looks_beside(mesh_path: Path, count: int) -> Looks | None:
    """Looks of the image NAME_texture.png beside a mesh file of `count` triangles, or None."""
    for ending in _IMAGE_ENDINGS:
        path = mesh_path.with_name(f"{mesh_path.stem}_texture{ending}")
        if path.is_file():
            paint = Paint(image=ImageSource(path, path.name))
            return Looks((paint,), np.zeros(count, np.int64))
    return None
