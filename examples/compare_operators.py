"""The four wave operators side by side: the same bump on the same sphere, and a table of their errors.

    python examples/compare_operators.py

writes out/compare_operators.png. The ring should be a circle round the point it came from, and lie on the dashed one.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ripple_sim.bench.accuracy import arrivals, sphere_modes
from ripple_sim.solver import WaveSolver, sphere_atlas
from ripple_sim.solver.atlas.sampling import sampling_matrix
from ripple_sim.solver.waves.operator import OPERATORS

SIZE, TIME, SOURCE = 360, 0.8, np.array([0.45, 0.25, 0.86])
CALM, HIGH, LOW = np.array([244, 242, 236]), np.array([200, 60, 40]), np.array([30, 90, 170])


def view(operator: str) -> Image.Image:
    """The sphere seen from the bump, coloured by its height."""
    atlas = sphere_atlas(1.0, 96)
    source = SOURCE / np.linalg.norm(SOURCE)
    angle = np.arccos(np.clip(atlas.positions @ source, -1, 1))
    waves = WaveSolver(atlas, operator=operator, backend="cpu")
    waves.add_height(np.exp(-((angle / 0.09) ** 2) / 2))
    waves.step(TIME)
    x, y = np.meshgrid(np.linspace(-1.05, 1.05, SIZE), np.linspace(1.05, -1.05, SIZE))
    right = np.cross([0, 1, 0], source)
    right /= np.linalg.norm(right)
    up = np.cross(source, right)
    seen = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    directions = (x[..., None] * right + y[..., None] * up + z[..., None] * source)[seen]
    height = sampling_matrix(directions, 96) @ waves.height.ravel()
    strength = np.clip(np.abs(height) / 0.1, 0, 1)[:, None]
    pixels = np.full((SIZE, SIZE, 3), 255.0)
    shade = 0.55 + 0.45 * z[seen][:, None]
    pixels[seen] = shade * ((1 - strength) * CALM + strength * np.where(height[:, None] > 0, HIGH, LOW))
    image = Image.fromarray(pixels.astype(np.uint8))
    draw = ImageDraw.Draw(image)
    radius, middle = np.sin(TIME) * (SIZE - 1) / 2.1, (SIZE - 1) / 2
    for start in range(0, 360, 6):
        draw.arc(
            [middle - radius, middle - radius, middle + radius, middle + radius], start, start + 2, fill=(40, 40, 40)
        )
    draw.text((10, 8), operator, fill=(20, 20, 20), font_size=18)
    return image


def main() -> None:
    picture = Image.new("RGB", (SIZE * len(OPERATORS), SIZE), "white")
    for i, operator in enumerate(OPERATORS):
        picture.paste(view(operator), (i * SIZE, 0))
    path = Path("out/compare_operators.png")
    path.parent.mkdir(exist_ok=True)
    picture.save(path)
    modes, times = sphere_modes((16, 32, 64)), arrivals([], sources=1)["limbed"]
    print(f"{'':14}  sphere mode, N = 16 / 32 / 64    order  arrival on a body with limbs: median, 90 %")
    for operator in OPERATORS:
        mode, time = modes[operator], times[operator]
        errors = " / ".join(f"{mode[n]:.2g}" for n in ("16", "32", "64"))
        print(f"{operator:14}  {errors:30}  {mode['order']:6.2f}  {time['front_median']:.2%}, {time['front_q90']:.2%}")
    print(path)


if __name__ == "__main__":
    main()
