"""A `Target` says how a geom ripples; arguments of `Ripples` fill what it leaves open."""

import dataclasses
import warnings

import mujoco
import numpy as np
import pytest

from ripple_sim import Material, Ripples, Target
from ripple_sim.errors import SceneError

MODEL = """<mujoco><worldbody>
  <geom name="egg" type="ellipsoid" size="0.4 0.3 0.3"/>
  <geom name="box" type="box" size="0.3 0.3 0.1" pos="2 0 0"/>
  <body pos="0 0 0.38"><freejoint/><geom size="0.05"/></body>
  <body pos="2 0 0.18"><freejoint/><geom size="0.05"/></body></worldbody></mujoco>"""
MATERIAL = Material(speed=0.5, damping=1.0, density=50.0)


@pytest.fixture
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MODEL)


def heights(model: mujoco.MjModel, ripples: Ripples) -> np.ndarray:
    """All heights after a tenth of a second, in which both targets are hit."""
    data = mujoco.MjData(model)
    ripples.mj_step(data, nstep=50)
    return np.concatenate([ripples[name].height.ravel() for name in ripples])


def test_arguments_fill_fields_that_a_target_leaves_open(model: mujoco.MjModel) -> None:
    targets = {"egg": Target(MATERIAL), "box": Target(MATERIAL, resolution=12, layout="patches")}
    ripples = Ripples(model, targets, resolution=8, layout="cube", backend="cpu")
    assert (ripples["egg"].atlas.resolution, ripples["egg"].atlas.layout) == (8, "cube")
    assert ripples["box"].atlas.layout == "patches"
    # patches have about 6 N^2 texels, as the cube has
    assert ripples["box"].atlas.areas.size == pytest.approx(6 * 12**2, rel=0.5)


def test_targets_and_mappings_by_geom_give_the_same_waves(model: mujoco.MjModel) -> None:
    targets = {"egg": Target(MATERIAL, resolution=8), "box": Target(MATERIAL, resolution=12)}
    new = heights(model, Ripples(model, targets, backend="cpu"))
    with pytest.warns(
        DeprecationWarning,
        match=r"resolution as a mapping by geom.*Target\(material, resolution=...\)",
    ):
        old = Ripples(
            model,
            {"egg": MATERIAL, "box": MATERIAL},
            resolution={"egg": 8, "box": 12},
            backend="cpu",
        )
    assert np.array_equal(heights(model, old), new)
    assert np.abs(new).max() > 0


def test_one_value_for_all_targets_is_not_deprecated(model: mujoco.MjModel) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        Ripples(
            model,
            {"egg": MATERIAL, "box": Target(MATERIAL)},
            resolution=8,
            layout="cube",
            backend="cpu",
        )


def test_a_mapping_that_leaves_a_geom_out_is_refused(model: mujoco.MjModel) -> None:
    with (
        pytest.warns(DeprecationWarning),
        pytest.raises(SceneError, match="layout has no entry for geom 'box'"),
    ):
        Ripples(
            model,
            {"egg": MATERIAL, "box": MATERIAL},
            resolution=8,
            layout={"egg": "cube"},
            backend="cpu",
        )


def test_hits_of_one_target_may_have_hertz_s_pulse(model: mujoco.MjModel) -> None:
    with pytest.raises(SceneError, match=r"modulus of geom 'egg', .*, got None Pa"):
        Ripples(model, {"egg": Target(MATERIAL, pulse="hertz")}, resolution=8, backend="cpu")
    hard = {"egg": Target(MATERIAL, pulse="hertz", modulus=1e6), "box": MATERIAL}
    soft = heights(
        model, Ripples(model, {"egg": MATERIAL, "box": MATERIAL}, resolution=8, backend="cpu")
    )
    mixed = heights(model, Ripples(model, hard, resolution=8, backend="cpu"))
    egg = slice(0, 6 * 8**2)
    box = slice(6 * 8**2, None)
    assert not np.array_equal(mixed[egg], soft[egg])
    assert np.array_equal(mixed[box], soft[box])


@pytest.mark.parametrize(("limit", "count"), [(True, 1), (False, 0)])
def test_only_targets_with_a_limit_get_warnings_of_high_waves(
    model: mujoco.MjModel, limit: bool, count: int
) -> None:
    light = dataclasses.replace(MATERIAL, density=0.01)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        ripples = Ripples(model, {"egg": Target(light, limit=limit)}, resolution=8, backend="cpu")
        heights(model, ripples)
        ripples.reset()  # which looks at the heights a last time
    assert sum("too high" in str(each.message) for each in told) == count


def test_values_that_are_neither_material_nor_target_are_refused(model: mujoco.MjModel) -> None:
    with pytest.raises(
        SceneError, match=r"material of geom 'egg' must be a Material or a Target, got 0\.5"
    ):
        Ripples(model, {"egg": 0.5})  # type: ignore[dict-item]
