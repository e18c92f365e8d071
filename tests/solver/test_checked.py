"""Bad arguments raise our error with the argument, its value and the expected values."""

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
        "wavelengths must be two numbers.*, got None m",
    ),
    "longest first": (
        lambda: Material(wavelengths=(2, 1)),
        r"wavelengths must be two numbers.*, got \(2, 1\) m",
    ),
    "preset of a list": (
        lambda: Material.preset([]),
        r"preset must be one of membrane, .*, gelatine-3, .*, got \[\]",
    ),
    "preset without what it needs": (
        lambda: Material.preset("dent"),
        r"the preset 'dent' needs yield_height: write Material.preset\('dent', yield_height=",
    ),
    "nothing inside": (
        lambda: thickness_map(ATLAS, None),
        "inside must be a Mesh, a Volume, or several.*, got None",
    ),
    "inside nothing": (
        lambda: thickness_map(None, ATLAS.mesh),
        "atlas must be an Atlas.*, got None",
    ),
    "limits of text": (
        lambda: thickness_map(ATLAS, ATLAS.mesh, "ab"),
        "limits must be a least and .*, got 'ab'",
    ),
    "no atlas": (lambda: WaveSolver(None), "atlas must be an Atlas.*, got None"),
    "no material": (lambda: WaveSolver(ATLAS, 3), "material must be a Material.*, got 3"),
    "point of text": (
        lambda: WAVES.add_impulse("abc", 1, 1),
        "points must be numbers .*, got 'abc'",
    ),
    "huge impulse": (
        lambda: WAVES.add_impulse([1, 0, 0], HUGE, 1),
        "impulse must be a finite number.*, got 1000.* N s",
    ),
    "height of text": (
        lambda: setattr(WAVES, "height", "a"),
        "height must be a number, or an array .*, got 'a'",
    ),
    "speed of text": (
        lambda: ATLAS.stiffness("a"),
        "speed must be a number, or an array .*, got 'a'",
    ),
    "no path": (lambda: ATLAS.save(None), "path must be a path.*, got None"),
    "path with NUL": (lambda: load_mesh("a\0b"), r"path must be a path.*, got 'a\\x00b'"),
    "atlas from nothing": (lambda: load_atlas(None), "path must be a path.*, got None"),
    "long name": (lambda: load_mesh("a" * 5000), "cannot be read: File name too long"),
    "long atlas": (lambda: load_atlas("a" * 5000), "atlas file 'aaa.*File name too long"),
    "long scene": (lambda: load_scene("a" * 5000), "there is no scene 'aaa"),
    "no mesh": (lambda: build_atlas(None), "mesh must be a Mesh.*, got None"),
    "radius of text": (
        lambda: sphere_atlas(radius="a"),
        "radius must be a finite number greater than 0, got 'a'",
    ),
    "steps of text": (
        lambda: RIPPLES.mj_step(mujoco.MjData(MODEL), nstep="a"),
        "nstep must be a whole number, 0 or greater, got 'a'",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_error_names_argument_value_and_expected_values(case: str) -> None:
    call, message = WRONG[case]
    with pytest.raises(RippleError, match=message):
        call()


def test_a_refused_call_changes_nothing() -> None:
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
