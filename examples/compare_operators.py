"""The four wave operators side by side: the same bump on the same sphere, and errors.

    python examples/compare_operators.py

writes out/compare_operators.png. The ring's crest should lie on the dashed circle, all the way
round.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ripple_sim.bench import sphere_modes
from ripple_sim.solver import WaveSolver, sphere_atlas
from ripple_sim.solver.operator import OPERATORS

sys.path.append(str(Path(__file__).parents[0] / "benchmarks"))
from arrival import arrivals, plane_arrival

SIZE = 360
CAPTION = 76
SMOOTH = 2
RESOLUTION = 96
TIME = 0.8
WIDTH = 0.09
SOURCE = np.array([0.45, 0.25, 0.86])
CALM = np.array([244, 242, 236])
HIGH = np.array([200, 60, 40])
LOW = np.array([30, 90, 170])
# height of the deepest colour, about that of the exact ring's crest
FULL = 0.2


def crest_angle() -> float:
    """Distance of the crest at TIME [rad], as on a plane: a sphere differs little so near."""
    angle = np.linspace(5 * WIDTH, 2 * TIME, 200)
    return float(np.interp(TIME, plane_arrival(angle / WIDTH)[1] * WIDTH, angle))


def view(operator: str) -> Image.Image:
    """The sphere seen from the bump, coloured by its height."""
    atlas = sphere_atlas(1.0, RESOLUTION)
    source = SOURCE / np.linalg.norm(SOURCE)
    angle = np.arccos(np.clip(atlas.positions @ source, -1, 1))
    waves = WaveSolver(atlas, operator=operator, backend="cpu", conserve_volume=False)
    waves.add_height(np.exp(-((angle / WIDTH) ** 2) / 2))
    waves.step(TIME)
    size = SMOOTH * SIZE
    x, y = np.meshgrid(np.linspace(-1.05, 1.05, size), np.linspace(1.05, -1.05, size))
    right = np.cross([0, 1, 0], source)
    right /= np.linalg.norm(right)
    up = np.cross(source, right)
    seen = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    directions = (x[..., None] * right + y[..., None] * up + z[..., None] * source)[seen]
    height = waves.atlas.sampling_matrix(directions) @ waves.height.ravel()
    strength = np.clip(np.abs(height) / FULL, 0, 1)[:, None]
    pixels = np.full((size, size, 3), 255.0)
    shade = 0.55 + 0.45 * z[seen][:, None]
    pixels[seen] = shade * (
        (1 - strength) * CALM + strength * np.where(height[:, None] > 0, HIGH, LOW)
    )
    image = Image.fromarray(pixels.astype(np.uint8))
    draw = ImageDraw.Draw(image)
    radius = np.sin(crest_angle()) * (size - 1) / 2.1
    middle = (size - 1) / 2
    box = [middle - radius, middle - radius, middle + radius, middle + radius]
    for start in range(0, 360, 6):
        draw.arc(box, start, start + 2, fill=(20, 20, 20), width=SMOOTH)
    return image.resize((SIZE, SIZE), Image.Resampling.LANCZOS)


def main() -> None:
    modes = sphere_modes((16, 32, 64))
    times = arrivals({}, RESOLUTION, sources=1)["limbed"]
    picture = Image.new("RGB", (SIZE * len(OPERATORS), SIZE + CAPTION), "white")
    draw = ImageDraw.Draw(picture)
    print(
        "               mode of the sphere, relative error       wave front on a body with limbs, "
        "late or early by"
    )
    print("               N = 16   N = 32   N = 64   order         median     90 %     under 3 %")
    for i, operator in enumerate(OPERATORS):
        mode = modes[operator]
        time = times[operator]
        row = "".join(f"{mode[n]:9.2g}" for n in ("16", "32", "64"))
        median = time["front_median"]
        most = time["front_q90"]
        share = time["front_under_3_percent"]
        print(
            f"{operator:13}{row}{abs(mode['order']):8.2f}{median:15.2%}{most:9.2%}{share:10.0%} of "
            f"the surface"
        )
        picture.paste(view(operator), (i * SIZE, 0))
        middle = (i + 0.5) * SIZE
        draw.text((middle, SIZE + 6), operator, fill=(20, 20, 20), font_size=20, anchor="ma")
        note = f"sphere mode off by {mode['64']:.2g}; front on a body by {median:.1%}"
        draw.text((middle, SIZE + 38), note, fill=(90, 90, 90), font_size=14, anchor="ma")
    path = Path("out/compare_operators.png")
    path.parent.mkdir(exist_ok=True)
    picture.save(path)
    print(path)


if __name__ == "__main__":
    main()
