"""Figure 8: a texture for the wave speed, and one for the damping.

python examples/paper/figure_8.py
"""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
from page import Part
from PIL import Image
from stills import strip

from ripple_sim import Scene, load_scene
from ripple_sim.scene import MapEntry, MaterialEntry

TIMES = [0.25, 0.4, 0.6, 0.8]
SIZE = (400, 400)
MATERIALS = {"speed": (0.15, 0.6), "damping": (0.5, 20.0)}  # black and white: m/s, 1/s


def half(path: Path) -> None:
    """Write a picture: one half of the face is black, the other white, with a soft border."""
    u = (np.arange(512) + 0.5) / 512
    ramp = np.clip((u - 0.5) / 0.03 + 0.5, 0, 1)
    Image.fromarray(np.broadcast_to(255 * ramp, (256, 512)).astype(np.uint8)).save(path)


def scene_with(material: MaterialEntry) -> Scene:
    scene = load_scene("face")
    return dataclasses.replace(
        scene, targets=(msgspec.structs.replace(scene.targets[0], material=material),)
    )


def make(folder: Path) -> Part:
    texture = folder / "figure_8_texture.png"
    half(texture)
    base = MaterialEntry(speed=0.6, damping=1.0, stiffness=1000.0, viscosity=3e-4, density=330.0)
    pictures = [(texture, "The texture: black and white stand for the two ends of the range.")]
    for name, (low, high) in MATERIALS.items():
        material = msgspec.structs.replace(base, **{name: MapEntry(str(texture), low, high)})
        file = strip(scene_with(material), TIMES, folder / f"figure_8_{name}.png", SIZE)
        pictures.append(
            (file, f"As {name}, from {low:g} to {high:g}, at {', '.join(map(str, TIMES))} s.")
        )
    return Part(
        "Figure 8: speed and damping from a texture",
        "An image in the object's own texture coordinates is sampled once per texel. "
        "On one half of the head, waves are slower or decay faster.",
        pictures,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
