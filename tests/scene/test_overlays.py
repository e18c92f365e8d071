"""Overlays by name: what is understood, and what is refused."""

from pathlib import Path

import pytest

from ripple_sim.cli.main import main
from ripple_sim.errors import SceneError
from ripple_sim.scene.scene import NAMES, Request, parse_request


def test_request_takes_every_name_and_ranges() -> None:
    request = parse_request([" height=0.02", "contacts", "grid", "time", "energy "])
    assert request == Request("height", 0.02, True, True, True, True)
    assert parse_request(["velocity"]) == Request(heatmap="velocity")
    assert not parse_request([])
    assert parse_request(["time"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["hight"], ", ".join(NAMES)),
        ([""], "valid are"),
        (["height", "velocity"], "choose one"),
        (["height=0"], "positive number"),
        (["height=wide"], "positive number"),
        (["velocity=inf"], "m/s"),
        (["time=3"], "has no range"),
    ],
)
def test_request_refuses(words: list[str], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        parse_request(words)


@pytest.mark.parametrize(
    ("options", "said"),
    [(["--overlay", "height,hight"], "valid are height, velocity"), (["--compare", "fem"], "valid are paper")],
)
def test_program_refuses_bad_names(
    options: list[str], said: str, capsys: pytest.CaptureFixture, tmp_path: Path
) -> None:
    assert main(["render", "duck", "-o", str(tmp_path / "x.mp4"), *options]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
