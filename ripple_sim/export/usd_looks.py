"""Looks and textures as UsdPreviewSurface materials."""

from __future__ import annotations

from pathlib import Path

import mujoco
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from ripple_sim.encode.mark import png_mark
from ripple_sim.render.visuals.materials import texture_pixels

from .meshes import keep
from .visuals import Finish

_COAT_ROUGHNESS = 0.1
_WATER = 1.33  # refractive index of what is transparent


class Materials:
    """Materials under a prim, and their images in a folder beside the stage's file.

    Parameters
    ----------
    stage : Usd.Stage
    path : Sdf.Path
        Of the prim.
    model : mujoco.MjModel
    images : Path
        The folder; made when it is first needed.
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, model: mujoco.MjModel, images: Path) -> None:
        self._stage, self._model, self._images = stage, model, images
        self._path = UsdGeom.Scope.Define(stage, path).GetPath()
        self._made: dict[tuple, UsdShade.Material] = {}
        self._textures: dict[int, str] = {}

    def bind(self, mesh: UsdGeom.Mesh, finish: Finish) -> None:
        """Give a mesh its material, and its colour for viewers without materials."""
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*map(float, finish.color))])
        if finish.opacity < 1:
            mesh.CreateDisplayOpacityAttr([finish.opacity])
        key = finish.look, tuple(finish.color), finish.opacity, finish.texture
        if key not in self._made:
            self._made[key] = self._material(finish)
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._made[key])

    def _material(self, finish: Finish) -> UsdShade.Material:
        path = self._path.AppendChild(f"look_{len(self._made)}")
        material = UsdShade.Material.Define(self._stage, path)
        shader = UsdShade.Shader.Define(self._stage, path.AppendChild("surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        look, color = finish.look, Gf.Vec3f(*map(float, finish.color))
        for name, value in (
            ("roughness", look.roughness),
            ("metallic", look.metallic),
            ("clearcoat", look.coat),
            ("clearcoatRoughness", _COAT_ROUGHNESS),
            ("opacity", finish.opacity * (1 - look.transparency)),
            ("ior", _WATER if look.transparency else 1.5),
        ):
            shader.CreateInput(name, Sdf.ValueTypeNames.Float).Set(float(value))
        diffuse = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        if look.emission:
            shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(color * look.emission)
        if finish.texture >= 0:
            diffuse.ConnectToSource(self._image(path, finish.texture, color))
        else:
            diffuse.Set(color)
        # what UsdPreviewSurface has no word for; Blender takes such attributes over as custom properties
        for name, value in (
            ("translucency", look.translucency),
            ("sheen", look.sheen),
            ("transparency", look.transparency),
            ("opacity", finish.opacity),
        ):
            keep(material.GetPrim(), name, value)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        return material

    def _image(self, path: Sdf.Path, texture: int, tint: Gf.Vec3f) -> UsdShade.Output:
        """Node that reads an image, times a linear colour."""
        reader = UsdShade.Shader.Define(self._stage, path.AppendChild("st"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        image = UsdShade.Shader.Define(self._stage, path.AppendChild("image"))
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(self._file(texture))
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*tint, 1))
        for side in ("wrapS", "wrapT"):
            image.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
        st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
        return image.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)

    def _file(self, texture: int) -> str:
        """Write a texture once, and return where it is, from the stage's file."""
        if texture not in self._textures:
            self._images.mkdir(exist_ok=True)
            name = f"texture_{texture}.png"
            Image.fromarray(texture_pixels(self._model, texture)).save(self._images / name, pnginfo=png_mark())
            self._textures[texture] = f"./{self._images.name}/{name}"
        return self._textures[texture]
