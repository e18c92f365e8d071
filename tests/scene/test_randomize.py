"""Bodies vary by a seed within their ranges, and nothing else does."""

import mujoco
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.drop_model import BODY_SHAPES, RandomEntry, randomize

MJCF = """<mujoco><worldbody><geom name="table" type="box" size="1 1 0.1"/>
<body name="post" pos="0 0 1"><joint type="slide"/><geom name="post" size="0.1"/></body>
<body name="stone" pos="1 0 3" euler="10 0 0"><freejoint/><geom name="stone" size="0.1" density="500"/></body>
<body name="brick" pos="2 0 3"><freejoint/><geom name="brick" type="box" size="0.1 0.2 0.3" mass="2"/></body>
</worldbody></mujoco>"""


def varied(**entry: object) -> tuple[mujoco.MjModel, dict[str, np.ndarray]]:
    spec = mujoco.MjSpec.from_string(MJCF)
    shifts = randomize(spec, RandomEntry(**entry))
    return spec.compile(), shifts


BEFORE = mujoco.MjModel.from_xml_string(MJCF)
ALL = {"position": 0.2, "orientation": True, "size": (0.5, 2.0), "mass": (0.5, 2.0), "shapes": list(BODY_SHAPES)}


def test_the_same_seed_gives_the_same_model_and_another_seed_another() -> None:
    (one, shifts), (same, _), (other, _) = varied(**ALL, seed=1), varied(**ALL, seed=1), varied(**ALL, seed=2)
    for name in ("body_pos", "body_quat", "body_mass", "geom_size", "geom_type"):
        np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        if name != "geom_type":
            assert not np.array_equal(getattr(one, name), getattr(other, name))
    assert list(shifts) == ["stone", "brick"]


def test_without_ranges_nothing_varies() -> None:
    model, shifts = varied(seed=7)
    assert not np.any(list(shifts.values()))
    for name in ("body_pos", "body_quat", "body_mass", "body_inertia", "geom_size", "geom_type"):
        np.testing.assert_allclose(getattr(model, name), getattr(BEFORE, name), rtol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_bodies_move_by_their_shifts_which_stay_within_the_range(seed: int) -> None:
    model, shifts = varied(position=0.2, seed=seed)
    for name, shift in shifts.items():
        np.testing.assert_allclose(model.body(name).pos - BEFORE.body(name).pos, shift, atol=1e-12)
        assert 0 < np.abs(shift).max() <= 0.2
    np.testing.assert_array_equal(model.body("post").pos, BEFORE.body("post").pos)
    np.testing.assert_allclose(model.body("stone").quat, BEFORE.body("stone").quat, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_mass_goes_with_its_factor_and_with_the_size_only_where_a_density_is_given(seed: int) -> None:
    model, _ = varied(size=(0.5, 2.0), mass=(3.0, 3.0), seed=seed)
    factor = model.geom("stone").size[0] / 0.1
    assert 0.5 <= factor <= 2.0
    assert model.body("stone").mass[0] == pytest.approx(3 * factor**3 * BEFORE.body("stone").mass[0])
    assert model.body("brick").mass[0] == pytest.approx(3 * 2)
    factors = model.geom("brick").size / BEFORE.geom("brick").size
    np.testing.assert_allclose(factors, factors[0])


def test_factors_are_spread_evenly_over_their_logarithms() -> None:
    """Half and double are equally likely: the mean logarithm is 0."""
    factors = [varied(size=(0.5, 2.0), seed=seed)[0].geom("stone").size[0] / 0.1 for seed in range(200)]
    assert np.mean(np.log2(factors)) == pytest.approx(0, abs=0.12)
    assert np.std(np.log2(factors)) == pytest.approx(2 / np.sqrt(12), rel=0.1)


@pytest.mark.parametrize("shape", BODY_SHAPES)
def test_every_shape_compiles_and_has_about_the_volume_of_a_ball(shape: str) -> None:
    model, _ = varied(shapes=[shape])
    assert model.geom("stone").type == int(BODY_SHAPES[shape][0])
    assert model.body("stone").mass[0] == pytest.approx(BEFORE.body("stone").mass[0], rel=0.4)
    assert model.geom("table").type == BEFORE.geom("table").type


def test_orientations_cover_all_directions_even_where_the_mjcf_gives_angles() -> None:
    quaternions = np.array([varied(orientation=True, seed=seed)[0].body("stone").quat for seed in range(200)])
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1)
    np.testing.assert_allclose(quaternions.T @ quaternions / 200, np.eye(4) / 4, atol=0.08)


def test_only_the_bodies_that_are_named_vary() -> None:
    model, shifts = varied(bodies=["brick"], position=0.2)
    assert list(shifts) == ["brick"]
    np.testing.assert_array_equal(model.body("stone").pos, BEFORE.body("stone").pos)
    assert varied(bodies=[], position=0.2)[1] == {}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"bodies": ["post"]}, r"\[random\] names the body 'post'; the model's free bodies are stone, brick"),
        ({"size": (0.0, 1.0)}, r"size is \[0.0, 1.0\]; valid are two positive factors, the lower one first"),
        ({"mass": (2.0, 1.0)}, r"mass is \[2.0, 1.0\]"),
        ({"mass": (1.0, np.inf)}, r"mass is \[1.0, inf\]"),
        ({"size": (np.nan, 1.0)}, r"size is \[nan, 1.0\]"),
        ({"position": -0.1}, "position is -0.1 m; valid is 0 or greater"),
        ({"position": np.nan}, "position is nan"),
        ({"seed": -1}, "seed is -1; valid is 0 or greater"),
        ({"shapes": ["box", "cone"]}, "shape 'cone'; valid are sphere, box, capsule, ellipsoid, cylinder"),
    ],
)
def test_invalid_entries_are_named_with_what_is_valid(entry: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        varied(**entry)
