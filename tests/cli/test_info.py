"""The completion script, in a real shell; the table of `ripple-sim materials`."""

import json
import math
import shutil
import subprocess

import pytest

from ripple_sim.cli import main as cli
from ripple_sim.cli.main import main
from ripple_sim.solver import Material, SolverError
from ripple_sim.solver.operator.presets import PRESETS


def completed(script: str, line: str) -> set[str]:
    """What bash offers for the last word of a line."""
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    # the script says itself which function completes the program's name
    trial = f"""{script}
set -- $(complete -p ripple-sim)
while [ "$1" != -F ]; do shift; done
COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; COMP_LINE='{line}'; COMP_POINT={len(line)}
"$2" ripple-sim '{words[-1]}' '{words[-2]}'
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    result = subprocess.run(["bash", "--norc", "-c", trial], capture_output=True, text=True, check=True)
    return {word.strip() for word in result.stdout.split()}


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_commands_options_and_choices(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    for line, offered in (
        ("ripple-sim re", {"render"}),
        ("ripple-sim vi", {"view"}),
        ("ripple-sim render --dur", {"--duration"}),
        ("ripple-sim view --bench", {"--benchmark"}),
        ("ripple-sim render --backend c", {"cpu"}),
    ):
        assert completed(script, line) == offered


def test_zsh_gets_a_script_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", "zsh"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("#compdef ripple-sim")
    assert "render" in out
    assert err == ""


def test_an_unknown_shell_is_bad_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", "fish"]) == 2
    assert "bash" in capsys.readouterr().err


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
