"""New contexts of OpenGL: what is drawn first is checked, and errors are one line."""

import pytest

from ripple_sim.solver import GLError
from ripple_sim.solver.gl import creation, shared_context


def test_driver_that_draws_nothing_is_refused(
    opengl: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    with shared_context() as ctx:
        creation._check_first_picture(ctx)
        empty = "#version 330\nvoid main() { gl_Position = vec4(2.0); }"
        monkeypatch.setattr(creation, "_FIRST_VERTEX_SHADER", empty)
        with pytest.raises(GLError, match="drew the first picture wrong; please report this"):
            creation._check_first_picture(ctx)


def test_the_error_without_egl_and_display_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(creation, "egl_exists", lambda: False)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":987")  # there is no such display
    with pytest.raises(GLError, match=r"neither of EGL nor of the platform's window system"):
        creation.create_context(None)
