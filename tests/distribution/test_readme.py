"""The README's examples do what it says."""

import re
import tomllib
from pathlib import Path

import pytest

from ripple_sim.scene.scene_file import parse_scene
from ripple_sim.scenes.shapes import peanut, write_obj

README = Path(__file__).parents[2] / "README.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.filterwarnings("error::ripple_sim.errors.RippleWarning")
@pytest.mark.parametrize(("number", "shown"), [(0, "N s at"), (1, ""), (2, "solid_angle")])
def test_python_examples_run(number: int, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    write_obj(tmp_path / "my_mesh.obj", *peanut())
    exec(compile(blocks("python")[number], f"README python block {number}", "exec"), {})
    assert shown in capsys.readouterr().out


def test_scene_example_is_valid() -> None:
    [example] = blocks("toml")
    assert parse_scene(tomllib.loads(example), "README").ripple[0].geom == "duck"


def test_own_loop_is_short() -> None:
    # the ten lines that the README promises a MuJoCo user: what is not the model itself
    code = blocks("python")[0]
    own = re.sub(r'model = .*?"""\)\n', "", code, flags=re.DOTALL)
    assert len([line for line in own.splitlines() if line.strip()]) <= 10
