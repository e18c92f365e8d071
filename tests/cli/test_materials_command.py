"""`ripple-sim materials`."""

import json
import math

import pytest

from ripple_sim.cli.main import main
from ripple_sim.solver import Material, SolverError
from ripple_sim.solver.operator.presets import PRESETS


def test_every_material_is_listed_with_source_speed_and_decay(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == list(PRESETS)
    q = 2 * math.pi / 0.05
    skin = told["drum-skin"]
    damping = skin["parameters"]["damping"] / 2
    expected = math.sqrt(3990 / 0.262 - (damping / q) ** 2)
    assert skin["speed [m/s]"] == pytest.approx(expected)
    assert skin["decay [s]"] == pytest.approx(1 / damping)
    assert all(row["source"] and row["valid"] for row in told.values())


def test_the_table_is_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials"]) == 0
    assert "gelatine-5" in capsys.readouterr().out


def test_a_preset_takes_other_parameters_and_tells_which() -> None:
    assert Material.preset("gelatine-5", thickness=0.1).stiffness == pytest.approx(
        Material.preset("gelatine-5").stiffness / 4
    )
    with pytest.raises(SolverError, match="no parameter 'tension'; valid are modulus"):
        Material.preset("gelatine-5", tension=1.0)
    with pytest.raises(SolverError, match="'custard' does not exist; valid are gelatine-3"):
        Material.preset("custard")
