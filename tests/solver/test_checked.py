"""Senseless arguments of public functions raise our own error: it names the argument, the value and what is valid."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from ripple_sim import Ripples, load_scene
from ripple_sim.solver import (
    Material,
    RippleError,
    WaveSolver,
    load_mesh,
    sphere_atlas,
    thickness_map,
)
from ripple_sim.solver.errors import PATH, POSITIVE, Valid, checked, instance, shown, whole
from ripple_sim.solver.layouts import build_atlas, load_atlas

HUGE = 10**400  # no float holds it
ATLAS = sphere_atlas(resolution=4)
WAVES = WaveSolver(ATLAS, backend="cpu")
MODEL = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><geom name='g' size='1'/></worldbody></mujoco>"
)
RIPPLES = Ripples(MODEL, {"g": Material()}, resolution=4, backend="cpu")

WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "waves of nothing": (
        lambda: Material(wavelengths=None),
        "wavelengths is None m; valid are two numbers",
    ),
    "longest first": (
        lambda: Material(wavelengths=(2, 1)),
        r"wavelengths is \(2, 1\) m; valid are two numbers",
    ),
    "preset of a list": (
        lambda: Material.preset([]),
        r"preset \[\] does not exist; valid are gelatine-3, ",
    ),
    "nothing inside": (
        lambda: thickness_map(ATLAS, None),
        "inside is None; valid is a Mesh, a Volume, or several",
    ),
    "inside nothing": (lambda: thickness_map(None, ATLAS.mesh), "atlas is None; valid is an Atlas"),
    "limits of text": (
        lambda: thickness_map(ATLAS, ATLAS.mesh, "ab"),
        "limits is 'ab'; valid is a least and",
    ),
    "no atlas": (lambda: WaveSolver(None), "atlas is None; valid is an Atlas"),
    "no material": (lambda: WaveSolver(ATLAS, 3), "material is 3; valid is a Material"),
    "point of text": (
        lambda: WAVES.add_impulse("abc", 1, 1),
        "points are 'abc'; valid are numbers",
    ),
    "huge impulse": (
        lambda: WAVES.add_impulse([1, 0, 0], HUGE, 1),
        "impulse is 1000.* N s; valid is a finite number",
    ),
    "height of text": (
        lambda: setattr(WAVES, "height", "a"),
        "height is 'a'; valid is a number, or an array",
    ),
    "speed of text": (lambda: ATLAS.stiffness("a"), "speed is 'a'; valid is a number, or an array"),
    "no path": (lambda: ATLAS.save(None), "path is None; valid is a path"),
    "path with NUL": (lambda: load_mesh("a\0b"), r"path is 'a\\x00b'; valid is a path"),
    "atlas from nothing": (lambda: load_atlas(None), "path is None; valid is a path"),
    "long name": (lambda: load_mesh("a" * 5000), "cannot be read: File name too long"),
    "long atlas": (lambda: load_atlas("a" * 5000), "atlas file 'aaa.*File name too long"),
    "long scene": (lambda: load_scene("a" * 5000), "there is no scene 'aaa"),
    "no mesh": (lambda: build_atlas(None), "mesh is None; valid is a Mesh"),
    "radius of text": (
        lambda: sphere_atlas(radius="a"),
        "radius is 'a'; valid is a finite number greater than 0",
    ),
    "steps of text": (
        lambda: RIPPLES.mj_step(mujoco.MjData(MODEL), nstep="a"),
        "nstep is 'a'; valid is a whole number, 0 or greater",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_error_names_argument_value_and_what_is_valid(case: str) -> None:
    call, message = WRONG[case]
    with pytest.raises(RippleError, match=message):
        call()


def test_what_was_refused_has_changed_nothing() -> None:
    assert not WAVES.height.any()
    assert WAVES.time == 0.0


@checked(RippleError, count=whole(1), size=POSITIVE, path=PATH, other=instance(dict, optional=True))
def called(count: Any = 1, *, size: Any = 1.0, path: Any = ".", other: Any = None) -> tuple:
    """Return its arguments."""
    return count, size, path, other


def test_valid_arguments_go_through_in_every_form() -> None:
    assert called() == (1, 1.0, ".", None)
    assert called(np.int64(3), size=np.float32(2), path=Path("a"), other={}) == (
        3,
        2.0,
        Path("a"),
        {},
    )
    assert (called.__name__, called.__doc__) == ("called", "Return its arguments.")


def test_a_wrong_name_stays_pythons_error() -> None:
    with pytest.raises(TypeError, match="radius"):
        called(radius=1)


def test_values_are_shown_at_no_great_length() -> None:
    class Shy:
        def __repr__(self) -> str:
            raise RuntimeError

    assert shown("a" * 10_000).startswith("'aaa")
    assert len(shown("a" * 10_000)) < 200
    assert shown(Shy()) == "a value of type Shy"
    assert shown(10**5000) == "a value of type int"  # more digits than Python prints
    assert Valid(lambda value: True, "").holds(Shy())
