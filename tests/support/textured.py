"""Models whose material has a texture of four squares."""

import mujoco
import numpy as np

# a texture of four squares: red and green above blue and yellow
COLORS = {"r": (255, 0, 0), "g": (0, 255, 0), "b": (0, 0, 255), "y": (255, 255, 0)}
TEXTURE = '<texture name="t" type="{kind}" builtin="flat" width="64" height="{height}"/>'
MATERIAL = '<material name="m" texture="t" specular="0" {}/>'


def textured_model(
    body: str, attributes: str = "", *, kind: str = "2d", asset: str = "", material: str = MATERIAL
):
    """Model of a body with the material "m"; `attributes` are the material's."""
    texture = TEXTURE.format(kind=kind, height=64 if kind == "2d" else 384)
    xml = f"<mujoco><asset>{texture}{material.format(attributes)}{asset}</asset>"
    xml += f"<worldbody>{body}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    squares = np.array([["r", "g"], ["b", "y"]]).repeat(32, axis=0).repeat(32, axis=1)
    image = np.array([[COLORS[name] for name in row] for row in squares], dtype=np.uint8)
    model.tex_data[: 3 * 64 * 64] = image.ravel()
    if kind == "cube":
        for face, name in enumerate("rgbyrg"):  # right, left, up, down, front, back
            model.tex_data[3 * 4096 * face : 3 * 4096 * (face + 1)] = np.tile(COLORS[name], 4096)
    return model
