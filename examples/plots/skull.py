"""A ball on forehead, cheek and nose of a head with a skull: height of the skin there.

    python examples/plots/skull.py [--resolution 96]

writes out/plots/skull.png: the scene `skull` with the bone from its mesh, and from a scan of the
head, 10 mm voxels with noise.
"""

import argparse
import dataclasses
import sys
import tempfile
from pathlib import Path

import msgspec
import numpy as np
from figure import FAINT, FOLDER, TEXT, plain, save, sheet

from ripple_sim import Scene, Simulation, load_scene
from ripple_sim.scene import InsideEntry

sys.path.append(str(Path(__file__).parents[1] / "scene_meshes"))
from head import BONE_THRESHOLD, head_volume

# 1/s, s, m
FPS = 240
SHOWN = 1.2
VOXEL = 0.01
NAMES = {"forehead": "forehead", "cheek": "cheek", "nose": "nose tip"}
COLORS = {"bone from a mesh": "#1f5fa8", "bone from voxels": "#d1632f"}


def from_scan(scene: Scene, folder: Path) -> Scene:
    """The scene with the skull as a scanner sees it."""
    values, origin = head_volume(VOXEL)
    np.save(folder / "head.npy", values)
    scan = InsideEntry(
        volume=str(folder / "head.npy"),
        threshold=BONE_THRESHOLD,
        spacing=VOXEL,
        origin=tuple(origin.tolist()),
    )
    [target] = scene.targets
    return dataclasses.replace(scene, targets=(msgspec.structs.replace(target, inside=[scan]),))


def curves(scene: Scene, resolution: int) -> dict[str, tuple[float, np.ndarray]]:
    """Thickness [m] where each ball hits first, and the heights there [m] from then on."""
    simulation = Simulation(scene, fps=FPS, resolution=resolution, backend="cpu")
    heights = []
    struck = {}
    for frame in range(int(scene.duration * FPS)):
        simulation.advance_frame()
        heights.append(simulation.ripples["head"].height)
        for impulse in simulation.impulses:
            struck.setdefault(impulse.other.split("/")[0], (frame - 1, impulse.texel))
    waves = simulation.ripples["head"]
    thickness = np.asarray(waves.material.density) / (0.665 * 1000.0)
    found = {}
    for ball, (first, texel) in struck.items():
        swing = np.array([height[texel] for height in heights[first : first + int(SHOWN * FPS)]])
        found[ball] = float(thickness[texel]), swing
    return found


def make(folder: Path, resolution: int = 96) -> Path:
    scene = load_scene("skull")
    with tempfile.TemporaryDirectory() as scratch:
        scenes = {"bone from a mesh": scene, "bone from voxels": from_scan(scene, Path(scratch))}
        found = {name: curves(each, resolution) for name, each in scenes.items()}
    figure = sheet(
        13.0,
        4.6,
        "The same ball on three places of a head",
        "height of the skin where it was struck",
    )
    lowest = min(swing.min() for each in found.values() for _, swing in each.values())
    highest = max(swing.max() for each in found.values() for _, swing in each.values())
    for k, (ball, name) in enumerate(NAMES.items()):
        axes = figure.add_axes((0.07 + 0.32 * k, 0.14, 0.27, 0.60))
        plain(axes, "time [s]", "height [mm]" if k == 0 else "")
        depths = [1e3 * each[ball][0] for each in found.values()]
        axes.set_title(
            f"{name}: {depths[0]:.0f} mm over bone, {depths[1]:.0f} in voxels",
            fontsize=11,
            color=TEXT,
            loc="left",
        )
        for label, each in found.items():
            swing = each[ball][1]
            style = "-" if label == "bone from a mesh" else "--"
            axes.plot(
                np.arange(len(swing)) / FPS,
                1e3 * swing,
                style,
                color=COLORS[label],
                linewidth=1.5,
                label=label,
            )
        axes.axhline(0, color=FAINT, linewidth=0.6)
        axes.set_ylim(1.1e3 * lowest, 1.1e3 * highest)
        if k == 2:
            axes.legend(frameon=False, fontsize=9.5, labelcolor=TEXT, loc="lower right")
    return save(figure, folder, "skull")


def main() -> None:
    parser = argparse.ArgumentParser(description="Curves of height on a head with a skull.")
    parser.add_argument("--resolution", type=int, default=96)
    print(make(FOLDER, parser.parse_args().resolution))


if __name__ == "__main__":
    main()
