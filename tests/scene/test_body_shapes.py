"""Falling bodies of all shapes are about as large as the ball they stand for."""

import mujoco
import numpy as np
import pytest

from ripple_sim.scene.drop_model import BODY_SHAPES


@pytest.mark.parametrize("shape", BODY_SHAPES)
def test_bodies_of_every_shape_weigh_and_reach_about_as_a_ball_does(shape: str) -> None:
    kind, proportions = BODY_SHAPES[shape]
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    body.add_geom(type=kind, size=[0.1 * part for part in proportions], density=400)
    model = spec.compile()
    assert mujoco.mjtGeom(model.geom_type[0]).name == f"mjGEOM_{shape.upper()}"
    assert model.body("body").mass[0] == pytest.approx(400 * 4 / 3 * np.pi * 0.001, rel=0.4)
    assert 0.05 <= model.geom_aabb[0, 3:].min() <= model.geom_aabb[0, 3:].max() <= 0.151
