"""Bodies of a default scene: their size, waiting, dropping, and variation by a seed."""

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import forwarded

from ripple_sim.errors import SceneError
from ripple_sim.scene import BODY_SHAPES, DropEntry, RandomEntry, drop_model, randomize


def table() -> tuple[np.ndarray, np.ndarray]:
    """A column of 0.5 m under a wide plate at 0.9 to 1 m: only the plate's top is open."""
    profile = np.array([[0, 0], [0.1, 0], [0.1, 0.9], [0.5, 0.9], [0.5, 1.0], [0, 1.0]])
    solid = trimesh.creation.revolve(profile, sections=24)
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def compiled(bodies: int, seed: int) -> tuple[mujoco.MjModel, list[DropEntry]]:
    shapes = [list(BODY_SHAPES)[i % len(BODY_SHAPES)] for i in range(bodies)]
    spec, drops = drop_model(*table(), shapes, np.random.default_rng(seed))
    return spec.compile(), drops


def test_bodies_drop_from_above_the_open_surface_one_after_the_other() -> None:
    _, drops = compiled(30, 0)
    places = np.array([drop.position for drop in drops])
    assert (np.hypot(*places[:, :2].T) <= 0.5).all(), (
        "over the round plate, not beside it in its bounding box"
    )
    assert ((places[:, 2] >= 1.8 - 1e-5) & (places[:, 2] <= 2.2 + 1e-5)).all()
    assert np.ptp(places[:, :2], axis=0).min() > 0.5, "all over the plate"
    times = np.array([drop.time for drop in drops])
    assert times[0] == pytest.approx(0.1)
    np.testing.assert_allclose(np.diff(times), 3.4 / 30)


def test_no_body_drops_into_the_one_before_on_a_narrow_post() -> None:
    post = trimesh.creation.box((0.06, 0.06, 1.0))
    for seed in range(5):
        _, drops = drop_model(
            post.vertices + 0.5, post.faces, ["sphere"] * 12, np.random.default_rng(seed)
        )
        times, heights = np.array([(drop.time, drop.position[2]) for drop in drops]).T
        assert (np.diff(heights) + 9.81 / 2 * np.diff(times) ** 2 > 0.19).all(), (
            "it has fallen by more than its size"
        )
        assert heights.max() <= 2.2


def test_bodies_take_turns_in_shape_and_wait_where_none_touches_another() -> None:
    model, drops = compiled(12, 3)
    data = forwarded(model)
    kinds = [int(kind) for kind, _ in BODY_SHAPES.values()]
    for i, drop in enumerate(drops):
        geom = model.geom(f"body_{i}")
        assert (drop.body, geom.type) == (geom.name, kinds[i % len(kinds)])
        assert 0.02 < geom.size[0] < 0.11 and geom.rgba[3] == 1
    waiting = {model.geom(drop.body).id for drop in drops}
    assert not [contact for contact in data.contact if waiting & set(contact.geom.tolist())]


@pytest.mark.parametrize("bodies", [0, 1])
def test_a_scene_with_few_bodies_or_none_compiles(bodies: int) -> None:
    model, drops = compiled(bodies, 0)
    assert len(drops) == bodies
    assert (model.ngeom, model.nq) == (2 + bodies, 7 * bodies)


def test_the_seed_determines_the_whole_scene() -> None:
    (one, drops) = compiled(6, 1)
    (same, same_drops) = compiled(6, 1)
    (other, _) = compiled(6, 2)
    assert drops == same_drops
    for name in ("geom_size", "geom_rgba", "body_quat"):
        np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        assert not np.array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("shape", BODY_SHAPES)
def test_bodies_of_every_shape_have_about_the_mass_and_size_of_a_ball(shape: str) -> None:
    kind, proportions = BODY_SHAPES[shape]
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    body.add_geom(type=kind, size=[0.1 * part for part in proportions], density=400)
    model = spec.compile()
    assert mujoco.mjtGeom(model.geom_type[0]).name == f"mjGEOM_{shape.upper()}"
    assert model.body("body").mass[0] == pytest.approx(400 * 4 / 3 * np.pi * 0.001, rel=0.4)
    assert 0.05 <= model.geom_aabb[0, 3:].min() <= model.geom_aabb[0, 3:].max() <= 0.151


MJCF = """<mujoco><worldbody><geom name="table" type="box" size="1 1 0.1"/>
<body name="post" pos="0 0 1"><joint type="slide"/><geom name="post" size="0.1"/></body>
<body name="stone" pos="1 0 3" euler="10 0 0"><freejoint/>
<geom name="stone" size="0.1" density="500"/></body>
<body name="brick" pos="2 0 3"><freejoint/>
<geom name="brick" type="box" size="0.1 0.2 0.3" mass="2"/></body>
</worldbody></mujoco>"""


def varied(**entry: object) -> tuple[mujoco.MjModel, dict[str, np.ndarray]]:
    spec = mujoco.MjSpec.from_string(MJCF)
    shifts = randomize(spec, RandomEntry(**entry))
    return spec.compile(), shifts


BEFORE = mujoco.MjModel.from_xml_string(MJCF)
ALL = {
    "position": 0.2,
    "orientation": True,
    "size": (0.5, 2.0),
    "mass": (0.5, 2.0),
    "shapes": list(BODY_SHAPES),
}


def test_the_same_seed_gives_the_same_model_and_another_seed_another() -> None:
    (one, shifts) = varied(**ALL, seed=1)
    (same, _) = varied(**ALL, seed=1)
    (other, _) = varied(**ALL, seed=2)
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
def test_mass_scales_with_its_factor_and_with_the_size_where_a_density_is_given(
    seed: int,
) -> None:
    model, _ = varied(size=(0.5, 2.0), mass=(3.0, 3.0), seed=seed)
    factor = model.geom("stone").size[0] / 0.1
    assert 0.5 <= factor <= 2.0
    assert model.body("stone").mass[0] == pytest.approx(
        3 * factor**3 * BEFORE.body("stone").mass[0]
    )
    assert model.body("brick").mass[0] == pytest.approx(3 * 2)
    factors = model.geom("brick").size / BEFORE.geom("brick").size
    np.testing.assert_allclose(factors, factors[0])


def test_factors_are_spread_evenly_over_their_logarithms() -> None:
    """Half and double are equally likely: the mean logarithm is 0."""
    factors = [
        varied(size=(0.5, 2.0), seed=seed)[0].geom("stone").size[0] / 0.1 for seed in range(200)
    ]
    assert np.mean(np.log2(factors)) == pytest.approx(0, abs=0.12)
    assert np.std(np.log2(factors)) == pytest.approx(2 / np.sqrt(12), rel=0.1)


def test_orientations_cover_all_directions_even_where_the_mjcf_gives_angles() -> None:
    quaternions = np.array(
        [varied(orientation=True, seed=seed)[0].body("stone").quat for seed in range(200)]
    )
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1)
    np.testing.assert_allclose(quaternions.T @ quaternions / 200, np.eye(4) / 4, atol=0.08)


def test_only_named_bodies_vary() -> None:
    model, shifts = varied(bodies=["brick"], position=0.2)
    assert list(shifts) == ["brick"]
    np.testing.assert_array_equal(model.body("stone").pos, BEFORE.body("stone").pos)
    assert varied(bodies=[], position=0.2)[1] == {}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            {"bodies": ["post"]},
            r"\[random\] names the body 'post'; the model's free bodies are stone, brick",
        ),
        (
            {"size": (0.0, 1.0)},
            r"size must be two positive factors, the lower one first, got \[0.0, 1.0\]",
        ),
        ({"mass": (2.0, 1.0)}, r"mass must be .*, got \[2.0, 1.0\]"),
        ({"mass": (1.0, np.inf)}, r"mass must be .*, got \[1.0, inf\]"),
        ({"size": (np.nan, 1.0)}, r"size must be .*, got \[nan, 1.0\]"),
        ({"position": -0.1}, "position must be 0 or greater, got -0.1 m"),
        ({"position": np.nan}, "position must be .*, got nan"),
        ({"seed": -1}, "seed must be 0 or greater, got -1"),
        (
            {"shapes": ["box", "cone"]},
            "shapes must be of sphere, box, capsule, ellipsoid, cylinder, got 'cone'",
        ),
    ],
)
def test_invalid_entries_are_named_with_what_is_valid(entry: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        varied(**entry)
