"""MuJoCo's viewer with ripples, on a virtual screen."""

import os
from pathlib import Path

import mujoco
import pytest
from programs import ended

from ripple_sim import Material, Ripples, launch_passive
from ripple_sim.errors import DisplayError


def test_checks_pass_on_a_screen(screen: str) -> None:
    checks = Path(__file__).with_name("passive_checks.py")
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", str(checks))
    result = ended(*words, env={**os.environ, "DISPLAY": screen}, timeout=600)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_error_without_a_display_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom name="ball" size="1"/></worldbody></mujoco>'
    )
    ripples = Ripples(
        model, {"ball": Material(speed=1.0, density=10.0)}, resolution=8, backend="cpu"
    )
    with pytest.raises(DisplayError, match="RippleRenderer renders frames without"):
        launch_passive(model, mujoco.MjData(model), ripples)
