"""What `ripple-sim info` reports, with OpenGL and without."""

import json

import pytest

from ripple_sim import diagnostics
from ripple_sim.cli import main as cli
from ripple_sim.solver.backends import backend
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import context
from ripple_sim.solver.gl import context as gl


@pytest.fixture
def no_egl(monkeypatch):
    """Let every EGL library be missing, as on a machine without Mesa."""
    monkeypatch.setattr(gl, "_shared", {})
    monkeypatch.setattr(context, "_LIBRARIES", ({"libegl": "libEGL-missing.so", "libgl": "libGL-missing.so"},))


def report(capsys) -> dict:
    assert cli.main(["info", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_info_names_versions_and_driver(capsys):
    got = report(capsys)
    assert all(got["versions"].values())
    assert {"ripple-sim", "python", "mujoco", "numpy", "numba", "moderngl", "av"} <= set(got["versions"])
    context = gl.shared_context()
    assert got["opengl"]["renderer"] == context.renderer
    assert got["opengl"]["software"] is context.software


def test_info_names_the_backend_that_auto_takes(capsys):
    got = report(capsys)
    assert got["backend"] == ("cpu" if got["opengl"]["software"] else "gl") == backend.auto_backend()


def test_without_egl_info_says_what_to_install(capsys, no_egl):
    with pytest.raises(GLError):
        gl.shared_context()
    got = report(capsys)
    assert got["opengl"] is None
    assert got["backend"] == "cpu"
    assert "apt-get install" in got["advice"]
    assert "libegl1" in got["advice"]


def test_without_egl_the_text_says_so_too(capsys, no_egl):
    assert cli.main(["info"]) == 0
    out = capsys.readouterr().out
    assert "none: rendering is impossible" in out
    assert "apt-get install" in out


def test_a_missing_package_is_reported(monkeypatch):
    monkeypatch.setattr(diagnostics, "PACKAGES", ("ripple-sim", "no-such-package"))
    got = diagnostics.collect()
    assert got.versions["no-such-package"] is None
    assert "not installed" in diagnostics.as_text(got)
