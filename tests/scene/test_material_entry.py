"""Presets in scene files: the same material as in Python, with coefficients on top, and strictly checked."""

import dataclasses
import inspect

import pytest

from ripple_sim import Material, RippleError
from ripple_sim.scene.material_entry import LAWS, MaterialChange, MaterialEntry, PresetEntry
from ripple_sim.scene.scene_file import parse_scene


def material_of(table: dict) -> Material:
    scene = parse_scene({"model": "m.xml", "ripple": [{"geom": "g", "material": table}]}, "scene.toml")
    return scene.ripple[0].material.material()


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({}, Material()),
        ({"speed": 2, "density": 5.0}, Material(speed=2.0, density=5.0)),
        ({"tightening": 1.0}, Material(tightening=1.0)),
        ({"preset": "jelly"}, Material.jelly()),
        ({"preset": {"name": "layer", "modulus": 2e3, "thickness": 0.02}}, Material.layer(2e3, thickness=0.02)),
        ({"preset": "gelatine-7"}, Material.preset("gelatine-7")),
        ({"preset": {"name": "drum-skin", "tension": 4500.0}}, Material.preset("drum-skin", tension=4500.0)),
        ({"preset": "plate"}, Material.plate()),
        ({"preset": {"name": "membrane", "tension": 8.0, "density": 2.0}}, Material.membrane(8.0, 2.0)),
        ({"preset": {"name": "dent", "yield_height": 0.01}}, Material.dent(0.01)),
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
def test_preset_gives_what_is_left_out(table: dict, expected: Material) -> None:
    assert dataclasses.asdict(material_of(table)) == dataclasses.asdict(expected)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"preset": "foam"}, "'foam' does not exist; valid are membrane, layer, jelly, plate, dent, water, gelatine-3"),
        (
            {"preset": {"name": "membrane", "modulus": 1.0}},
            "no parameter 'modulus'; valid are tension, density, damping",
        ),
        ({"preset": "dent"}, "needs yield_height: write preset = "),
        ({"preset": {"name": "jelly", "modulus": -1.0}}, "modulus is -1.0 Pa"),
        (
            {"preset": {"name": "jelly", "elasticity": 1.0}},
            r"'elasticity' in \[ripple.material.preset\]; valid are name, t",
        ),
        ({"preset": {"modulus": 1.0}}, "missing required field `name`"),
        ({"preset": 3}, "Expected `str | object | null`"),
        ({"preset": {"name": "jelly", "modulus": float("inf")}}, "ripple.material.preset.modulus is inf"),
    ],
)
def test_wrong_presets_are_refused_with_what_is_valid(table: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        material_of(table)


@pytest.mark.parametrize("name", ["tightening", "deep"])
def test_what_is_the_same_everywhere_takes_no_map(name: str) -> None:
    with pytest.raises(RippleError, match=rf"Expected `float \| null`, got `str` - at `ripple\[0\].material.{name}`"):
        material_of({name: "map.png"})


def test_entries_have_the_coefficients_and_parameters_of_the_solver() -> None:
    coefficients = {each.name for each in dataclasses.fields(Material) if isinstance(each.default, float)}
    assert set(MaterialChange.__struct_fields__) == coefficients
    assert set(MaterialEntry.__struct_fields__) == coefficients | {"preset"}
    parameters = {name for law in LAWS for name in inspect.signature(getattr(Material, law)).parameters}
    assert set(PresetEntry.__struct_fields__) == parameters | {"name"}
