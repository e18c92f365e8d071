"""Material maps in scene files: from a picture, through the mesh's own texture coordinates, to the waves."""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene_file import MapEntry, MaterialEntry, parse_scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver import SolverError, texture_map


def test_eyes_of_the_face_stay_still() -> None:
    simulation = Simulation(load_scene("face"), fps=30, resolution=64, backend="cpu")
    waves = simulation.ripples["face"]
    for _ in range(18):
        simulation.advance_frame()
    still = texture_map(waves.atlas, simulation.scene.targets[0].still_map) < 0.5
    assert 0.01 < still.mean() < 0.1
    # all of it is on the two eyeballs
    eyes = [simulation.ripples.to_geom("face", [0.205, y, 0.445]) for y in (0.108, -0.108)]
    away = np.linalg.norm(waves.atlas.positions[still][:, None] - eyes, axis=2)
    assert (away.min(axis=1) < 0.1).all()
    assert (np.bincount(away.argmin(axis=1), minlength=2) > 0.3 * still.sum()).all()
    highest = np.abs(waves.height).max()
    assert highest > 1e-3
    assert np.quantile(np.abs(waves.height[still]), 0.9) < 0.01 * highest


def test_coefficients_are_numbers_paths_or_tables() -> None:
    content = parse_scene(
        {
            "model": "a.xml",
            "ripple": [
                {
                    "geom": "a",
                    "material": {"speed": "s.png", "damping": {"map": "d.png", "high": 5.0}, "bending": 0.2},
                }
            ],
        },
        "scene.toml",
    )
    maps = content.ripple[0].material.located(Path("folder")).maps()
    assert set(maps) == {"speed", "damping"}
    assert maps["damping"].map == str(Path("folder") / "d.png")
    assert (maps["damping"].low, maps["damping"].high) == (0.0, 5.0)
    material = content.ripple[0].material.material()
    assert (material.speed, material.damping, material.bending) == (1.0, 5.0, 0.2)


def test_unknown_keys_of_a_map_are_refused() -> None:
    table = {"model": "a.xml", "ripple": [{"geom": "a", "material": {"speed": {"map": "s.png", "hight": 2.0}}}]}
    with pytest.raises(SceneError, match="unknown key 'hight'"):
        parse_scene(table, "scene.toml")


def test_missing_picture_is_named() -> None:
    scene = load_scene("face")
    entry = msgspec.structs.replace(scene.targets[0], material=MaterialEntry(speed=MapEntry("slot_scratch.png")))
    with pytest.raises(SolverError, match=r"slot_scratch\.png.* cannot be read"):
        Simulation(dataclasses.replace(scene, targets=(entry,)), resolution=16, backend="cpu")
