"""The image that colours a target, in the model that MuJoCo draws too."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh

from .mesh_image import load_image, mesh_image


def paint_target(spec: mujoco.MjSpec, mesh: Mesh, mesh_path: str | Path, texture: str | Path | None) -> None:
    """Give the geom "target" the image that is asked for or that the mesh names, if the mesh can show it.

    Raises
    ------
    SceneError
        If an image that is asked for cannot be read, or the mesh has no texture coordinates.
    """
    if mesh.corner_uv is None:
        if texture is not None:
            raise SceneError(
                f"texture {str(texture)!r} cannot be shown on {str(mesh_path)!r}, which has no texture coordinates: "
                "choose a mesh that has them (a wrap has none)"
            )
        return
    pixels = mesh_image(mesh_path) if texture is None else load_image(texture)
    if pixels is None:
        return
    asset = spec.mesh("target")
    # MuJoCo counts v from the image's upper edge
    asset.usertexcoord = (mesh.corner_uv * [1.0, -1.0] + [0.0, 1.0]).ravel()
    asset.userfacetexcoord = np.arange(mesh.F.size)
    height, width, channels = pixels.shape
    image = spec.add_texture(
        name="target", type=mujoco.mjtTexture.mjTEXTURE_2D, height=height, width=width, nchannel=channels
    )
    image.data = pixels.tobytes()
    spec.add_material(name="target").textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "target"
    spec.geom("target").material = "target"
