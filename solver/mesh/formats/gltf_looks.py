"""Materials of glTF 2.0 files.

They are metallic-roughness, or the extension specular-glossiness.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ..looks import BLEND, CLAMP, MASK, MASK_CUTOFF, MIRROR, OPAQUE, REPEAT, ImageSource, Paint
from .gltf_document import Document

# Wrap modes of samplers (section 3.8.4.2).
_WRAPS = {33071: CLAMP, 33648: MIRROR, 10497: REPEAT}

_ALPHA_MODES = {"OPAQUE": OPAQUE, "MASK": MASK, "BLEND": BLEND}

# Extensions of textures that name images in other formats, those that pillow reads first.
_OTHER_IMAGES = ("EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds", "KHR_texture_basisu")

_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_TRANSFORM = "KHR_texture_transform"
_STRENGTH = "KHR_materials_emissive_strength"
_UNLIT = "KHR_materials_unlit"

# What extensions of materials add and is not shown, in words.
_NOT_SHOWN = {
    "KHR_materials_anisotropy": "anisotropy",
    "KHR_materials_clearcoat": "clear coats",
    "KHR_materials_diffuse_transmission": "transmission",
    "KHR_materials_dispersion": "dispersion",
    "KHR_materials_iridescence": "iridescence",
    "KHR_materials_sheen": "sheen",
    "KHR_materials_subsurface": "scattering",
    "KHR_materials_transmission": "transmission",
    "KHR_materials_variants": "variants",
    "KHR_materials_volume": "volumes",
}


class GltfMaterial(NamedTuple):
    """A material, and the texture coordinates of its image.

    Attributes
    ----------
    paint : Paint
    uv_set : int
        Which of the texture coordinates of a primitive are used.
    uv_transform : float64 [2, 3]
        What is done to them.
    not_shown : frozenset of str
        What the material has besides.
    """

    paint: Paint
    uv_set: int
    uv_transform: NDArray[np.float64]
    not_shown: frozenset[str]


def gltf_material(document: Document, index: int) -> GltfMaterial:
    """One of the materials of a document."""
    material = document.entry("materials", index)
    extensions = material.get("extensions", {})
    metallic: float | None
    if _SPECULAR_GLOSSINESS in extensions:
        source = extensions[_SPECULAR_GLOSSINESS]
        color = source.get("diffuseFactor", [1.0] * 4)
        texture = source.get("diffuseTexture")
        metallic = 0.0
        roughness = 1.0 - _number(source.get("glossinessFactor", 1.0))
        gloss = None
    else:
        source = material.get("pbrMetallicRoughness", {})
        color = source.get("baseColorFactor", [1.0] * 4)
        texture = source.get("baseColorTexture")
        metallic = _number(source.get("metallicFactor", 1.0))
        roughness = _number(source.get("roughnessFactor", 1.0))
        gloss = _image(document, source.get("metallicRoughnessTexture"))
    image = _image(document, texture)
    emissive = material.get("emissiveTexture")
    emission = _emission(material)
    not_shown = _not_shown(material)
    if emissive is not None and texture is not None and any(emission):
        uv_set, uv_transform = _coordinates(texture)
        own_uv_set, own_transform = _coordinates(emissive)
        if own_uv_set != uv_set or not np.array_equal(own_transform, uv_transform):
            not_shown |= {"emission with texture coordinates of its own"}
            emission = (0.0, 0.0, 0.0)
    red, green, blue, opacity = (_number(value) for value in [*color, 1.0, 1.0, 1.0, 1.0][:4])
    paint = Paint(
        color=(red, green, blue, opacity),
        image=image,
        wrap=_wrap(document, texture),
        alpha=_ALPHA_MODES.get(material.get("alphaMode", "OPAQUE"), OPAQUE),
        cutoff=_number(material.get("alphaCutoff", MASK_CUTOFF)),
        metallic=metallic,
        roughness=roughness,
        gloss=gloss,
        emission=emission,
        emission_image=_image(document, emissive) if any(emission) else None,
        unlit=_UNLIT in extensions,
    )
    uv_set, uv_transform = _coordinates(emissive if texture is None else texture)
    return GltfMaterial(paint, uv_set, uv_transform, not_shown)


def _emission(material: dict[str, Any]) -> tuple[float, float, float]:
    """Linear light that a material emits; what is brighter than 1 keeps its hue."""
    factor = [_number(value) for value in [*material.get("emissiveFactor", ()), 0.0, 0.0, 0.0][:3]]
    strength = material.get("extensions", {}).get(_STRENGTH, {}).get("emissiveStrength", 1.0)
    light = max(_number(strength), 0.0) * np.array(factor)
    red, green, blue = (light / max(float(light.max()), 1.0)).tolist()
    return red, green, blue


def _not_shown(material: dict[str, Any]) -> frozenset[str]:
    words = {_NOT_SHOWN[name] for name in material.get("extensions", {}) if name in _NOT_SHOWN}
    if "normalTexture" in material:
        words.add("normal maps")
    if "occlusionTexture" in material:
        words.add("occlusion")
    return frozenset(words)


def _image(document: Document, texture_info: dict[str, Any] | None) -> ImageSource | None:
    """The image of a material's texture, in the first of its formats that pillow reads."""
    if texture_info is None:
        return None
    texture = document.entry("textures", texture_info.get("index"))
    if "source" in texture:
        return document.image(texture["source"])
    extensions = texture.get("extensions", {})
    for name in _OTHER_IMAGES:
        if name in extensions:
            return document.image(extensions[name].get("source"))
    return None


def _wrap(document: Document, texture_info: dict[str, Any] | None) -> tuple[str, str]:
    if texture_info is None:
        return REPEAT, REPEAT
    texture = document.entry("textures", texture_info.get("index"))
    if "sampler" not in texture:
        return REPEAT, REPEAT
    sampler = document.entry("samplers", texture["sampler"])
    along_u, along_v = (_WRAPS.get(sampler.get(name, 0), REPEAT) for name in ("wrapS", "wrapT"))
    return along_u, along_v


def _coordinates(texture_info: dict[str, Any] | None) -> tuple[int, NDArray[np.float64]]:
    """The set of texture coordinates of a texture, and their transform (KHR_texture_transform)."""
    if texture_info is None:
        return 0, np.eye(2, 3)
    uv_set = texture_info.get("texCoord", 0)
    change = texture_info.get("extensions", {}).get(_TRANSFORM, {})
    uv_set = change.get("texCoord", uv_set)
    offset = np.array(change.get("offset", (0.0, 0.0)), dtype=np.float64)
    scale = np.array(change.get("scale", (1.0, 1.0)), dtype=np.float64)
    angle = _number(change.get("rotation", 0.0))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return int(uv_set), np.column_stack([turn * scale, offset])


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MeshError(f"a material has {value!r} where a number must be")
    return float(value)
