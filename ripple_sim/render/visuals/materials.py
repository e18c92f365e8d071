"""MuJoCo's materials and textures, in the shaders' terms."""

from __future__ import annotations

from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.color import srgb_to_linear
from ripple_sim.render.resources import Resources
from ripple_sim.render.textures import srgb_cube, srgb_texture

from .looks import Look
from .visual import Visual


def look_of(model: Any, visual: Visual) -> Look:
    """Look of a visual's material; roughness is derived from MuJoCo's shininess where the material gives none."""
    red, green, blue = (float(x) for x in visual.color)
    rgb = red, green, blue
    material = visual.material
    if material < 0:
        return Look(color=rgb, roughness=0.42, coat=0.2)
    roughness, metallic = float(model.mat_roughness[material]), float(model.mat_metallic[material])
    if roughness < 0:
        roughness = 0.15 + 0.55 * (1.0 - float(model.mat_shininess[material]))
    coat = 0.4 * float(model.mat_specular[material]) + float(model.mat_reflectance[material])
    return Look(
        color=rgb,
        roughness=float(np.clip(roughness, 0.05, 1.0)),
        metallic=max(metallic, 0.0),
        coat=min(coat, 1.0),
        emission=float(model.mat_emission[material]),
    )


class Textures:
    """The textures of a model on the GPU, each uploaded at its first use."""

    def __init__(self, resources: Resources, model: Any) -> None:
        self._resources, self._model = resources, model
        self._uploaded: dict[int, moderngl.Texture | moderngl.TextureCube] = {}

    def get(self, texture: int) -> moderngl.Texture | moderngl.TextureCube:
        """Return the texture of an id; it reads as linear light."""
        if texture not in self._uploaded:
            pixels = texture_pixels(self._model, texture)
            flat = self._model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
            self._uploaded[texture] = srgb_texture(self._resources, pixels) if flat else self._cube(pixels)
        return self._uploaded[texture]

    def skybox(self) -> tuple[moderngl.TextureCube, NDArray[np.float64]] | None:
        """Return the model's skybox and its mean linear colour, or None."""
        for texture in range(self._model.ntex):
            if self._model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                pixels = texture_pixels(self._model, texture)
                self._uploaded[texture] = cube = self._cube(pixels)
                return cube, srgb_to_linear(pixels[::4, ::4] / 255.0).mean(axis=(0, 1))
        return None

    def _cube(self, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
        """Cube map of faces below one another."""
        size = pixels.shape[1]
        if pixels.shape[0] != 6 * size:  # one image for all faces
            pixels = np.concatenate([pixels[:size]] * 6)
        return srgb_cube(self._resources, pixels)


def texture_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels of a model's texture, uint8 [height, width, 3], top row first."""
    height, width, channels = (int(n[texture]) for n in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[texture])
    pixels = np.asarray(model.tex_data[start : start + height * width * channels]).reshape(height, width, channels)
    return np.ascontiguousarray(
        np.repeat(pixels[..., :1], 3, axis=2) if channels < 3 else pixels[..., :3], dtype=np.uint8
    )
