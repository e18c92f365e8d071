"""Materials in scene files: presets, checks, and maps from images."""

import dataclasses
import inspect
from pathlib import Path

import numpy as np
import pytest

from ripple_sim import Material, RippleError, Simulation
from ripple_sim.scene import (
    LAWS,
    MaterialChange,
    MaterialEntry,
    PresetEntry,
    load_scene,
    parse_scene,
)
from ripple_sim.solver import texture_map


def material_of(table: dict) -> Material:
    scene = parse_scene(
        {"model": "m.xml", "ripple": [{"geom": "g", "material": table}]}, "scene.toml"
    )
    return scene.ripple[0].material.material()


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({}, Material()),
        ({"speed": 2, "density": 5.0}, Material(speed=2.0, density=5.0)),
        ({"tightening": 1.0}, Material(tightening=1.0)),
        ({"preset": "jelly"}, Material.jelly()),
        ({"preset": "jelly"}, Material.preset("jelly")),
        (
            {"preset": {"name": "suited", "size": 2.0, "hit": [0.5, 4.0]}},
            Material.suited(2.0, (0.5, 4.0)),
        ),
        (
            {"preset": {"name": "layer", "modulus": 2e3, "thickness": 0.02}},
            Material.layer(2e3, thickness=0.02),
        ),
        ({"preset": "gelatine-7"}, Material.preset("gelatine-7")),
        (
            {"preset": {"name": "drum-skin", "tension": 4500.0}},
            Material.preset("drum-skin", tension=4500.0),
        ),
        ({"preset": "plate"}, Material.plate()),
        (
            {"preset": {"name": "membrane", "tension": 8.0, "density": 2.0}},
            Material.membrane(8.0, 2.0),
        ),
        (
            {"preset": {"name": "dent", "yield_height": 0.01}},
            Material.preset("dent", yield_height=0.01),
        ),
        # beside the preset stand the wave equation's own coefficients, in their own units
        (
            {"preset": {"name": "jelly", "density": 900.0}, "density": 40.0, "damping": 0.0},
            dataclasses.replace(Material.jelly(density=900.0), density=40.0, damping=0.0),
        ),
        (
            {"preset": "jelly", "speed": {"map": "waves.png", "high": 0.3}},
            dataclasses.replace(Material.jelly(), speed=0.3),
        ),
    ],
)
def test_preset_gives_coefficients_that_are_left_out(table: dict, expected: Material) -> None:
    assert dataclasses.asdict(material_of(table)) == dataclasses.asdict(expected)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"preset": "foam"},
            ("preset must be one of membrane, layer, jelly, plate, dent, water, suited, g"),
        ),
        (
            {"preset": {"name": "membrane", "modulus": 1.0}},
            "no parameter 'modulus'; its parameters are tension, density, damping",
        ),
        ({"preset": "dent"}, "needs yield_height: write dent,yield_height="),
        ({"preset": {"name": "jelly", "modulus": -1.0}}, "modulus must be .*, got -1.0 Pa"),
        (
            {"preset": {"name": "jelly", "elasticity": 1.0}},
            r"'elasticity' in \[ripple.material.preset\]; keys are name, t",
        ),
        ({"preset": {"modulus": 1.0}}, "missing required field `name`"),
        ({"preset": 3}, "Expected `str | object | null`"),
        (
            {"preset": {"name": "jelly", "modulus": float("inf")}},
            "ripple.material.preset.modulus must be .*, got inf",
        ),
    ],
)
def test_wrong_presets_are_refused_with_what_is_valid(table: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        material_of(table)


@pytest.mark.parametrize("name", ["tightening", "deep"])
def test_uniform_coefficients_take_no_map(name: str) -> None:
    with pytest.raises(
        RippleError,
        match=rf"Expected `float \| null`, got `str` - at `ripple\[0\].material.{name}`",
    ):
        material_of({name: "map.png"})


def test_entries_have_the_coefficients_and_parameters_of_the_solver() -> None:
    coefficients = {
        each.name for each in dataclasses.fields(Material) if isinstance(each.default, float)
    }
    assert set(MaterialChange.__struct_fields__) == coefficients
    assert set(MaterialEntry.__struct_fields__) == coefficients | {"preset"}
    parameters = {
        name for law in LAWS for name in inspect.signature(getattr(Material, law)).parameters
    }
    assert set(PresetEntry.__struct_fields__) == parameters | {"name"}


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
    table = {"speed": "s.png", "damping": {"map": "d.png", "high": 5.0}, "bending": 0.2}
    content = parse_scene(
        {"model": "a.xml", "ripple": [{"geom": "a", "material": table}]}, "scene.toml"
    )
    maps = content.ripple[0].material.located(Path("folder")).maps()
    assert set(maps) == {"speed", "damping"}
    assert maps["damping"].map == str(Path("folder") / "d.png")
    assert (maps["damping"].low, maps["damping"].high) == (0.0, 5.0)
    material = content.ripple[0].material.material()
    assert (material.speed, material.damping, material.bending) == (1.0, 5.0, 0.2)
