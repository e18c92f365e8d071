"""Fingerprints of every shipped scene: of its frames, and of its heights.

A refactoring leaves both as they are.

python examples/benchmarks/fingerprint.py [SCENE ...] > before.txt
"""

import hashlib
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from ripple_sim import Simulation, load_scene
from ripple_sim.cli.main import main as ripple_sim
from ripple_sim.scene import shipped_scenes

FPS = 12
OPTIONS = ("--size", "480x270", "--fps", str(FPS), "--backend", "cpu")


def frames(scene: str) -> str:
    """Fingerprint of the frames that `ripple-sim render` draws."""
    hasher = hashlib.sha256()
    with tempfile.TemporaryDirectory() as folder:
        if ripple_sim(["render", scene, "-o", f"{folder}/frames", *OPTIONS]) != 0:
            sys.exit(f"scene {scene} could not be rendered")
        for path in sorted(Path(folder, "frames").iterdir()):
            hasher.update(np.asarray(Image.open(path)).tobytes())
    return hasher.hexdigest()[:16]


def heights(name: str) -> str:
    """Fingerprint of all heights and impulses, frame by frame."""
    scene = load_scene(name)
    hasher = hashlib.sha256()
    simulation = Simulation(scene, fps=FPS, backend="cpu")
    for _ in range(round(scene.duration * FPS)):
        simulation.advance_frame()
        for surface in simulation.ripples:
            hasher.update(simulation.ripples[surface].height.tobytes())
        hasher.update(np.array([each.impulse for each in simulation.impulses]).tobytes())
    return hasher.hexdigest()[:16]


if __name__ == "__main__":
    for scene in sys.argv[1:] or shipped_scenes():
        print(f"{scene:10} frames {frames(scene)} heights {heights(scene)}", flush=True)
