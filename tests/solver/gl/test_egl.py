"""EGL: contexts by device, and which one is current."""

import threading

import pytest

from ripple_sim.solver import GLError
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.gl.context import create_context, current_context, load_egl


@pytest.mark.parametrize("device", [99, 1000])
def test_a_device_that_does_not_exist_is_named_in_the_error(opengl: None, device: int) -> None:
    with pytest.raises(GLError, match=rf"EGL device {device} \(.+\); devices are counted from 0"):
        create_context(device)


def test_without_any_device_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fail(**settings: object) -> None:
        asked.append((settings["device_index"], settings.get("libegl")))
        raise Exception("requested device index 0, but found 0 devices")

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(GLError, match=r"any EGL device \(requested device.*apt-get install libegl1"):
        create_context(None)
    assert {name for _, name in asked} == {None, "libEGL.so.1"}
    assert {index for index, _ in asked} == set(range(8))


def test_a_library_that_cannot_be_loaded_is_not_asked_again_for_every_device(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fail(**settings: object) -> None:
        asked.append(settings.get("libegl"))
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(GLError, match="not loaded"):
        create_context(None)
    assert asked == [None, "libEGL.so.1"]


def test_the_context_that_is_entered_is_the_current_one(opengl: None) -> None:
    context = shared_context()
    with context:
        inside = current_context()
        with context:
            assert current_context() == inside
        assert current_context() == inside
    assert inside


def test_other_threads_have_no_current_context(opengl: None) -> None:
    seen = []
    with shared_context():
        thread = threading.Thread(target=lambda: seen.append(current_context()))
        thread.start()
        thread.join()
    assert seen == [None]


def test_the_library_knows_the_functions_that_fences_need(opengl: None) -> None:
    with shared_context():
        find = load_egl().eglGetProcAddress
        assert all(find(name) for name in (b"glFenceSync", b"glClientWaitSync", b"glDeleteSync"))
