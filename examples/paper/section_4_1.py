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
            "An exported page solves the waves in the browser. Click, touch or drag on the object "
            "to poke it, and drag beside it to turn the camera. You can change the speed, damping "
            "and stiffness of the waves while it runs. "
            f"A page of {OPTIONS.duration:g} s at N = {OPTIONS.resolution} is one file of "
            f"{megabytes:.1f} MB."
        ),
        live=SCENE,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
