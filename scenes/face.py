"""A face on an egg: a mesh with texture coordinates, and the picture that tells where waves run.

`python -m ripple_sim.scenes.face` writes `meshes/face.obj` and `meshes/face_waves.png` again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

FOLDER = Path(__file__).parent / "meshes"

# longitudes and latitudes of the mesh; the picture's pixels
_COLUMNS, _ROWS = 48, 24
_WIDTH, _HEIGHT = 512, 256


def write_mesh(path: Path) -> None:
    """Write the egg as OBJ: u is the longitude, with the face in the middle of the picture, v the latitude."""
    lines = ["# an egg 0.9 m high that faces +x"]
    latitude = np.pi * (np.arange(1, _ROWS) / _ROWS - 0.5)
    longitude = 2 * np.pi * (np.arange(_COLUMNS) / _COLUMNS - 0.5)
    for z in latitude:
        for a in longitude:
            # narrower above than below
            width = 0.36 * np.cos(z) * (1 - 0.12 * np.sin(z))
            lines.append(f"v {width * np.cos(a):.6f} {width * np.sin(a):.6f} {0.45 * np.sin(z):.6f}")
    lines += ["v 0 0 -0.45", "v 0 0 0.45"]
    south, north = len(latitude) * _COLUMNS + 1, len(latitude) * _COLUMNS + 2
    # one column more than there are vertices: at the back two pairs of coordinates meet
    lines += [f"vt {i / _COLUMNS:.6f} {j / _ROWS:.6f}" for j in range(_ROWS + 1) for i in range(_COLUMNS + 1)]

    def corner(j: int, i: int) -> str:
        vertex = south if j == 0 else north if j == _ROWS else (j - 1) * _COLUMNS + i % _COLUMNS + 1
        return f"{vertex}/{j * (_COLUMNS + 1) + i + 1}"

    for j in range(_ROWS):
        for i in range(_COLUMNS):
            a, b, c, d = corner(j, i), corner(j, i + 1), corner(j + 1, i + 1), corner(j + 1, i)
            if j == 0:
                lines.append(f"f {a} {c} {d}")
            else:
                lines.append(f"f {a} {b} {d}")
            if 0 < j < _ROWS - 1:
                lines.append(f"f {b} {c} {d}")
    path.write_text("\n".join(lines) + "\n")


def write_picture(path: Path) -> None:
    """Write where waves run: white; eyes and mouth, black, stay still."""
    picture = Image.new("L", (_WIDTH, _HEIGHT), 255)
    draw = ImageDraw.Draw(picture)
    middle = _WIDTH / 2
    for side in (-1, 1):
        x, y = middle + side * 34, 0.42 * _HEIGHT
        draw.ellipse([x - 15, y - 17, x + 15, y + 17], fill=0)
    draw.arc([middle - 42, 0.42 * _HEIGHT, middle + 42, 0.66 * _HEIGHT], 25, 155, fill=0, width=11)
    picture.save(path, optimize=True)


if __name__ == "__main__":
    write_mesh(FOLDER / "face.obj")
    write_picture(FOLDER / "face_waves.png")
