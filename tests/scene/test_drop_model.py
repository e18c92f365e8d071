"""Bodies of a default scene wait out of reach, and drop above the surface onto what is open to the sky."""

import mujoco
import numpy as np
import pytest
import trimesh

from ripple_sim.scene.drop_model import BODY_SHAPES, drop_model
from ripple_sim.scene.events import DropEntry


def table() -> tuple[np.ndarray, np.ndarray]:
    """A column of 0.5 m under a wide plate at 0.9 to 1 m: the only surface open to the sky is the plate's top."""
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
    assert (np.hypot(*places[:, :2].T) <= 0.5).all(), "over the round plate, not beside it in its bounding box"
    assert ((places[:, 2] >= 1.8 - 1e-5) & (places[:, 2] <= 2.2 + 1e-5)).all()
    assert np.ptp(places[:, :2], axis=0).min() > 0.5, "all over the plate"
    times = np.array([drop.time for drop in drops])
    assert times[0] == pytest.approx(0.1)
    np.testing.assert_allclose(np.diff(times), 3.4 / 30)


def test_bodies_take_turns_in_shape_and_wait_where_none_touches_another() -> None:
    model, drops = compiled(12, 3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    kinds = [int(kind) for kind, _ in BODY_SHAPES.values()]
    for i, drop in enumerate(drops):
        assert drop.body == f"body_{i}"
        assert model.geom(drop.body).type == kinds[i % len(kinds)]
        assert 0.02 < model.geom(drop.body).size[0] < 0.11
        assert model.geom(drop.body).rgba[3] == 1
    waiting = {model.geom(drop.body).id for drop in drops}
    assert not [contact for contact in data.contact if waiting & set(contact.geom.tolist())]


@pytest.mark.parametrize("bodies", [0, 1])
def test_a_scene_with_few_bodies_or_none_compiles(bodies: int) -> None:
    model, drops = compiled(bodies, 0)
    assert len(drops) == bodies
    assert (model.ngeom, model.nq) == (2 + bodies, 7 * bodies)


def test_the_seed_decides_everything() -> None:
    (one, drops), (same, same_drops), (other, _) = compiled(6, 1), compiled(6, 1), compiled(6, 2)
    assert drops == same_drops
    for name in ("geom_size", "geom_rgba", "body_quat"):
        np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        assert not np.array_equal(getattr(one, name), getattr(other, name))
