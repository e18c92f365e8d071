"""What can be opened, and pokes that suit it."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.viewer.opening import BALLS, open_scene, poke_strength
from ripple_sim.viewer.session import Session


@pytest.mark.parametrize("name", ["sphere", "rolling", "heavy", "animal"])
def test_the_suggested_poke_is_seen_but_not_absurd(name: str) -> None:
    session = Session(open_scene(name), resolution=32)
    [waves] = (session.simulation.ripples[geom] for geom in session.simulation.ripples)
    [geom] = session.simulation.ripples.geom_ids.values()
    middle = session.simulation.data.geom_xpos[geom]
    assert session.poke(middle + np.array([0, 0, 9]), [0, 0, -1]) is not None
    deepest = 0.0
    for _ in range(8):
        waves.step(1 / 30)  # without the bodies of the scene
        deepest = max(deepest, float(np.abs(waves.height).max()))
    assert 0.003 < deepest / session.size < 0.05


def test_meshes_and_scene_files_can_be_opened_and_mistakes_are_named(tmp_path: Path) -> None:
    write_obj(tmp_path / "peanut.obj", *peanut())
    scene = open_scene(tmp_path / "peanut.obj", bodies=0)
    assert scene.name == "peanut"
    assert scene.model.nbody == 1 + BALLS
    for wrong in ("no such thing", tmp_path / "missing.obj"):
        with pytest.raises(SceneError, match=r"there is no scene or mesh.*shipped scenes are"):
            open_scene(wrong)
    with pytest.raises(SceneError, match="there is no scene"):
        open_scene(tmp_path / "missing.toml")


def test_a_suggested_poke_scales_with_size_and_density() -> None:
    material = load_scene("sphere").targets[0].material.material()
    one, two = poke_strength(material, 1.0), poke_strength(material, 2.0)
    assert two.radius == pytest.approx(2 * one.radius)
    assert two.impulse > 4 * one.impulse
