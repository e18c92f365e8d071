"""Fixtures of the command line: it runs in this process, with a cache of its own."""

from collections.abc import Callable
from pathlib import Path

import pytest

from ripple_sim.cli import main as cli


@pytest.fixture(autouse=True)
def _left_as_found(
    signals_as_found: None,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
):
    """Keep the cache apart, and give the signals back."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture
def refusal(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run what must be refused; return its one line on stderr."""

    def run(*argv: str) -> str:
        assert cli.main(argv) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert err.startswith("ripple-sim: ") and err.endswith("\n") and len(err) < 900
        return err

    return run


@pytest.fixture
def tetrahedron(tmp_path: Path) -> Path:
    """An OBJ file."""
    path = tmp_path / "tetrahedron.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return path
