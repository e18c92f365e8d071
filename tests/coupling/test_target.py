"""A target whose material changes while its waves run."""

import mujoco
import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, RippleError, Ripples


def test_material_may_change_under_a_body_at_rest() -> None:
    """What the surface has not got yet of a long contact is not lost."""
    momenta = []
    for change in (False, True):
        model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.6"))
        data = mujoco.MjData(model)
        ripples = Ripples(
            model, {"target": Material(density=50.0)}, resolution=16, backend="cpu", conserve_volume=False
        )
        for step in range(800):
            mujoco.mj_step(model, data)
            ripples.step(data)
            if change and step == 300:
                ripples.change_material("target", speed=2.0)
        momenta.append(ripples["target"].momentum())
    assert momenta[1] == pytest.approx(momenta[0], rel=1e-4)
    with pytest.raises(RippleError, match="no coefficient 'sped'; valid are speed, damping"):
        ripples.change_material("target", sped=1.0)
