"""Looks of MuJoCo's materials."""

import pytest
from textured import textured_model

from ripple_sim.render.visuals.visual import geom_visual, look_of


def test_a_material_answers_light_as_it_says():
    """Roughness is taken where it is given; otherwise more shininess is less of it. Reflectance is a coat."""

    def look(attributes: str):
        return look_of(model := textured_model('<geom size=".1" material="m"/>', attributes), geom_visual(model, 0))

    assert look('roughness="0.3" metallic="1" shininess="0.9"').roughness == pytest.approx(0.3)
    assert look('roughness="0.3" metallic="1"').metallic == 1.0
    assert look('shininess="0"').roughness > look('shininess="0.5"').roughness > look('shininess="1"').roughness
    assert look('reflectance="0.4"').coat == pytest.approx(0.4)
    assert look('emission="0.7"').emission == pytest.approx(0.7)
    assert look("").metallic == 0.0
