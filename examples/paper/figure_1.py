"""Figure 1: a ball hits a character whose eyes carry no waves.

python examples/paper/figure_1.py
"""

from pathlib import Path

from page import Part
from stills import strip

from ripple_sim import load_scene


def make(folder: Path) -> Part:
    file = strip(load_scene("face"), [0.2, 0.35, 0.5, 0.8], folder / "figure_1.png", (400, 400))
    return Part(
        "Figure 1: a ball hits a face",
        "The ball is a rigid body of MuJoCo, and its contact force presses on the forehead. "
        "The waves go around the eyes, which an image marks as still.",
        [(file, "The scene `face` at 0.2, 0.35, 0.5 and 0.8 s.")],
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
