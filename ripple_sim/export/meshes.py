"""Meshes in a stage: what stays the same over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt


def define_mesh(
    stage: Usd.Stage, path: Sdf.Path, F: NDArray[np.int64], uv: NDArray[np.float64] | None, *, open_surface: bool
) -> UsdGeom.Mesh:
    """Define a mesh of triangles [m, 3], with texture coordinates [m, 3, 2] of their corners."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(open_surface)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(F), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(F, np.int32).ravel()))
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


def place(prim: UsdGeom.Xformable, position: NDArray, quaternion: NDArray, time: float | None = None) -> None:
    """Set where a prim is in its parent's frame: position [m], and quaternion, w first."""
    moment = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
    translate, orient = placing(prim)
    translate.Set(Gf.Vec3d(*map(float, position)), moment)
    orient.Set(Gf.Quatd(*map(float, quaternion)), moment)


def placing(prim: UsdGeom.Xformable) -> tuple[UsdGeom.XformOp, UsdGeom.XformOp]:
    """Translation and orientation of a prim, added where there are none."""
    translate, orient = prim.GetOrderedXformOps() or (
        prim.AddTranslateOp(),
        prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble),
    )
    return translate, orient


def child(stage: Usd.Stage, parent: Sdf.Path, name: str) -> Sdf.Path:
    """A path under a parent that is not taken, called as much like a name as USD allows."""
    valid = Tf.MakeValidIdentifier(name)
    path, number = parent.AppendChild(valid), 1
    while stage.GetPrimAtPath(path):
        number += 1
        path = parent.AppendChild(f"{valid}_{number}")
    return path


def keep(prim: Usd.Prim, name: str, value: float) -> None:
    """Keep a number with a prim, among the properties that are the user's own."""
    prim.CreateAttribute(f"userProperties:{name}", Sdf.ValueTypeNames.Float).Set(float(value))
