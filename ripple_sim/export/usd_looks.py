"""Parts of a USD stage that stay the same over time: meshes, looks with textures, and lamps.

Looks are UsdPreviewSurface materials; lamps are UsdLux lights.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from ripple_sim.encode.replace import png_mark
from ripple_sim.render.visuals.lights import Lighting
from ripple_sim.render.visuals.scene_light import lighting_of
from ripple_sim.render.visuals.visual import (
    texture_has_opacity,
    texture_is_half_clear,
    texture_pixels_with_opacity,
)

from .source import Source
from .visuals import Finish

_MIN_LAMP_RADIUS = 0.01  # of a lamp whose MJCF gives no radius [m]
_STUDIO_SKY = 0.25  # radiance of a sky in place of the studio's soft boxes, which USD does not have
_COAT_ROUGHNESS = 0.1
_HOLE_OPACITY = 0.5  # below which a texture with opacity has a hole
_WATER = 1.33  # refractive index of transparent surfaces


def define_mesh(
    stage: Usd.Stage,
    path: Sdf.Path,
    F: NDArray[np.int64],
    uv: NDArray[np.float64] | None,
    *,
    open_surface: bool,
) -> UsdGeom.Mesh:
    """Define a mesh of triangles [m, 3], with texture coordinates [m, 3, 2] of their corners."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(open_surface)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(F), 3))
    mesh.CreateFaceVertexIndicesAttr(
        Vt.IntArray.FromNumpy(np.ascontiguousarray(F, np.int32).ravel())
    )
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if uv is not None:
        kind = Sdf.ValueTypeNames.TexCoord2fArray
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.faceVarying)
        places, index = np.unique(uv.reshape(-1, 2).astype(np.float32), axis=0, return_inverse=True)
        primvar.Set(Vt.Vec2fArray.FromNumpy(places))
        primvar.SetIndices(Vt.IntArray.FromNumpy(index.ravel().astype(np.int32)))
    return mesh


def vectors(values: NDArray) -> Vt.Vec3fArray:
    """An array [n, 3] as USD takes it."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def extent(points: NDArray) -> Vt.Vec3fArray:
    """Bounding box of points [n, 3]."""
    return vectors(np.stack([points.min(axis=0), points.max(axis=0)]))


def place(
    prim: UsdGeom.Xformable, position: NDArray, quaternion: NDArray, time: float | None = None
) -> None:
    """Set where a prim is in its parent's frame: position [m], and quaternion, w first."""
    moment = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
    translate, orient = placing(prim)
    translate.Set(Gf.Vec3d(*map(float, position)), moment)
    orient.Set(Gf.Quatd(*map(float, quaternion)), moment)


def placing(prim: UsdGeom.Xformable) -> tuple[UsdGeom.XformOp, UsdGeom.XformOp]:
    """Translation and orientation of a prim, added where there are none."""
    double = UsdGeom.XformOp.PrecisionDouble
    return tuple(prim.GetOrderedXformOps()) or (prim.AddTranslateOp(), prim.AddOrientOp(double))


def child(stage: Usd.Stage, parent: Sdf.Path, name: str) -> Sdf.Path:
    """A path under a parent that is not taken, called as much like a name as USD allows."""
    valid = Tf.MakeValidIdentifier(name)
    path = parent.AppendChild(valid)
    number = 1
    while stage.GetPrimAtPath(path):
        number += 1
        path = parent.AppendChild(f"{valid}_{number}")
    return path


def keep(prim: Usd.Prim, name: str, value: float) -> None:
    """Keep a number with a prim, among the properties that are the user's own."""
    prim.CreateAttribute(f"userProperties:{name}", Sdf.ValueTypeNames.Float).Set(float(value))


class Lamps:
    """The lights of a source, which stand still or turn with the camera as its renderer's do.

    A white surface that faces a far light has the radiance that it has in the renderer; so it has
    at the model's middle for a near one, which falls off with the square of the distance everywhere
    else, as light does. They stand under the prim at a path.
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, source: Source) -> None:
        self._stage = stage
        self._source = source
        self._path = UsdGeom.Scope.Define(stage, path).GetPath()
        self._lamps: list[UsdGeom.Xformable] = []

    def begin(self, data: mujoco.MjData) -> None:
        """Define the lights of the first frame, which only move later."""
        lighting = self._lighting(data)
        for index, light in enumerate(lighting.lights):
            path = self._path.AppendChild(f"lamp_{index}")
            if light.position is None:
                lamp = UsdLux.DistantLight.Define(self._stage, path)
                angle = 2 * np.arctan(light.size)
                lamp.CreateAngleAttr(float(np.degrees(angle)))
                lamp.CreateNormalizeAttr(True)
                _set_light(lamp, light.radiance, np.pi, light.gloss)
                # [W/m^2], as Blender has it
                keep(lamp.GetPrim(), "power", np.pi * light.radiance.max())
                keep(lamp.GetPrim(), "angle", angle)  # [radians]
            else:
                lamp = UsdLux.SphereLight.Define(self._stage, path)
                lamp.CreateRadiusAttr(max(light.size, _MIN_LAMP_RADIUS))
                lamp.CreateNormalizeAttr(True)
                distance = max(
                    float(np.linalg.norm(light.position - self._source.model.stat.center)), 1e-3
                )
                # a sphere's irradiance is its intensity over four times the distance squared
                strength = np.pi / float(light.falloff @ [1.0, distance, distance**2])
                _set_light(lamp, light.radiance, 4 * distance**2 * strength, light.gloss)
                watts = 4 * np.pi * distance**2 * strength * light.radiance.max()
                keep(lamp.GetPrim(), "power", watts)  # as Blender has it
                if light.cutoff < np.pi:
                    shaping = UsdLux.ShapingAPI.Apply(lamp.GetPrim())
                    shaping.CreateShapingConeAngleAttr(float(np.degrees(light.cutoff)))
                    shaping.CreateShapingFocusAttr(light.exponent)
            placing(lamp)
            self._lamps.append(lamp)
        sky = lighting.ambient + (_STUDIO_SKY if lighting.studio else 0.0)
        if sky.any():
            _set_light(
                UsdLux.DomeLight.Define(self._stage, self._path.AppendChild("sky")), sky, 1.0
            )

    def write(self, data: mujoco.MjData, time: float) -> None:
        """Add a frame."""
        for lamp, light in zip(self._lamps, self._lighting(data).lights, strict=False):
            quaternion = np.zeros(4)  # it shines along its -z, against the direction
            mujoco.mju_quatZ2Vec(quaternion, np.ascontiguousarray(light.direction))
            place(lamp, np.zeros(3) if light.position is None else light.position, quaternion, time)

    def _lighting(self, data: mujoco.MjData) -> Lighting:
        return lighting_of(self._source.model, data, self._source.pose(data), self._source.lighting)


def _set_light(
    lamp: UsdLux.DistantLight, radiance: NDArray, intensity: float, gloss: float = 1.0
) -> None:
    brightest = max(float(radiance.max()), 1e-9)
    red, green, blue = (float(value) / brightest for value in radiance)
    lamp.CreateColorAttr(Gf.Vec3f(red, green, blue))
    lamp.CreateIntensityAttr(intensity * brightest)
    lamp.CreateSpecularAttr(gloss)


class Materials:
    """Materials under the prim at a path; each is defined when it is first needed.

    Their images are in a folder beside the file of the stage.
    """

    def __init__(
        self, stage: Usd.Stage, path: Sdf.Path, model: mujoco.MjModel, images: Path
    ) -> None:
        self._stage = stage
        self._model = model
        self._images = images
        self._path = UsdGeom.Scope.Define(stage, path).GetPath()
        self._made: dict[tuple, UsdShade.Material] = {}
        self._textures: dict[int, str] = {}

    def bind(self, mesh: UsdGeom.Mesh, finish: Finish) -> None:
        """Give a mesh its material, and its colour for viewers without materials."""
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*map(float, finish.color))])
        if finish.opacity < 1:
            mesh.CreateDisplayOpacityAttr([finish.opacity])
        key = finish.look, tuple(finish.color), finish.opacity, finish.texture, finish.glow
        if key not in self._made:
            self._made[key] = self._material(finish)
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._made[key])

    def _material(self, finish: Finish) -> UsdShade.Material:
        path = self._path.AppendChild(f"look_{len(self._made)}")
        material = UsdShade.Material.Define(self._stage, path)
        shader = UsdShade.Shader.Define(self._stage, path.AppendChild("surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        look = finish.look
        color = Gf.Vec3f(*map(float, finish.color))
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
            shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(
                color * look.emission
            )
        if finish.glow >= 0:
            image = self._image(path, finish.glow, Gf.Vec3f(1.0), "emission")
            emissive = shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f)
            emissive.ConnectToSource(image.GetOutput("rgb"))
        if finish.texture >= 0:
            image = self._image(path, finish.texture, color)
            diffuse.ConnectToSource(image.GetOutput("rgb"))
            if texture_has_opacity(self._model, finish.texture):
                shader.GetInput("opacity").ConnectToSource(image.GetOutput("a"))
                if not texture_is_half_clear(self._model, finish.texture):
                    threshold = shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float)
                    threshold.Set(_HOLE_OPACITY)
        else:
            diffuse.Set(color)
        # what UsdPreviewSurface has no word for; Blender takes such attributes over as custom
        # properties
        for name, value in (
            ("translucency", look.translucency),
            ("sheen", look.sheen),
            ("transparency", look.transparency),
            ("opacity", finish.opacity),
        ):
            keep(material.GetPrim(), name, value)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        return material

    def _image(
        self, path: Sdf.Path, texture: int, tint: Gf.Vec3f, name: str = "image"
    ) -> UsdShade.Shader:
        """Node that reads an image, times a linear colour, as "rgb", and its opacity, as "a"."""
        reader = UsdShade.Shader.Define(self._stage, path.AppendChild("st"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        image = UsdShade.Shader.Define(self._stage, path.AppendChild(name))
        image.CreateIdAttr("UsdUVTexture")
        if texture not in self._textures:  # where it is, from the stage's file
            self._images.mkdir(exist_ok=True)
            file = f"texture_{texture}.png"
            Image.fromarray(texture_pixels_with_opacity(self._model, texture)).save(
                self._images / file, pnginfo=png_mark()
            )
            self._textures[texture] = f"./{self._images.name}/{file}"
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(self._textures[texture])
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*tint, 1))
        for side in ("wrapS", "wrapT"):
            image.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
        st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
        image.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        image.CreateOutput("a", Sdf.ValueTypeNames.Float)
        return image
