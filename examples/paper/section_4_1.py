"""Section 4.1: the demonstration is stopped, reset and turned while it runs.

python examples/paper/section_4_1.py
"""

from pathlib import Path

from page import Part

from ripple_sim import ExportOptions, export_scene, load_scene

SCENE = "duck"
OPTIONS = ExportOptions(fps=30, duration=5.0, resolution=64, overwrite=True)


def make(folder: Path) -> Part:
    page = folder / "section_4_1.html"
    export_scene(load_scene(SCENE), page, OPTIONS)
    megabytes = page.stat().st_size / 1e6
    return Part(
        "Section 4.1: stop, reset and turn while it runs",
        (
            "A page solves the waves in the browser: click, touch or drag on the object to poke "
            "it, drag beside it to turn the camera. Speed, damping and stiffness of the waves "
            "change while it runs. "
            f"{OPTIONS.duration:g} s at N = {OPTIONS.resolution} are one file of "
            f"{megabytes:.1f} MB."
        ),
        live=SCENE,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
