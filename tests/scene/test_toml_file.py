"""TOML files of any content become a table or one line that says what is wrong."""

from pathlib import Path

import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene import read_toml


@pytest.mark.parametrize(
    "text, said",
    [
        (
            ".".join(["a"] * 200_000) + " = 1",
            r"plan '.*a\.toml' has a key of 200000 parts",
        ),  # tomllib would take half an hour
        ("[" + " . ".join(["'a'"] * 101) + "]", "has a key of 101 parts .*; valid are at most 100"),
        ("a = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a", "is not valid TOML"),
        ("a = \ud800", "cannot be read"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(text.encode(errors="surrogatepass"))
    with pytest.raises(SceneError, match=said):
        read_toml(path, "plan")


def test_dots_in_numbers_paths_and_comments_are_no_keys(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f"# {'.' * 300}\n# {'. ' * 300}\na = [{', '.join(['0.5'] * 300)}]\nb.c = '../../x.y'\n")
    assert read_toml(path, "plan") == {"a": [0.5] * 300, "b": {"c": "../../x.y"}}
