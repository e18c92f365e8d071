"""What is told of the contacts of a step: impulses for the user, touches for two-way coupling."""

import numpy as np
import pytest
from sphere_contacts import contacts_on, sphere_load, tilted

from ripple_sim.coupling.load import ContactRecord
from ripple_sim.coupling.patches import Pose, in_frame
from ripple_sim.solver import sphere_atlas

DT = 0.002
TOLD = ["globe", "one", "two", "three"], np.arange(4), sphere_atlas(1.0, 16), DT
EACH = {1: [((0, 0, 1), 5.0)], 3: [((1, 0, 0.1), 2.0), ((1, 0.2, 0), 1.0)]}


def record_of(each: dict = EACH, elapsed: float = DT) -> tuple[ContactRecord, Pose]:
    pose = tilted()
    return sphere_load().touched(contacts_on(pose, each), pose, DT, elapsed)[1], pose


def test_there_is_one_impulse_for_each_geom_with_its_name_and_all_of_its_force() -> None:
    record, _ = record_of()
    impulses = list(record.impulses(*TOLD))
    assert [(each.geom, each.other) for each in impulses] == [("globe", "one"), ("globe", "three")]
    assert [each.impulse for each in impulses] == pytest.approx([5.0 * DT, 3.0 * DT])


def test_impulses_do_not_depend_on_how_the_load_is_spread_over_time() -> None:
    for elapsed in (DT, 4 * DT):
        record, _ = record_of(elapsed=elapsed)
        assert sum(each.impulse for each in record.impulses(*TOLD)) == pytest.approx(8.0 * DT)


def test_points_lie_on_the_surface_in_the_world_under_the_middle_of_the_contacts() -> None:
    record, pose = record_of()
    for impulse, contacts in zip(record.impulses(*TOLD), EACH.values(), strict=True):
        [local] = in_frame(impulse.point[None], pose)
        assert np.linalg.norm(local) == pytest.approx(1.0, abs=1e-6), "on a sphere of 1 m"
        normals = np.array([np.array(normal) / np.linalg.norm(normal) for normal, _ in contacts])
        middle = np.array([force for _, force in contacts]) @ normals
        np.testing.assert_allclose(local, middle / np.linalg.norm(middle), atol=2e-3)


def test_the_point_lies_within_the_texel() -> None:
    directions = np.random.default_rng(0).standard_normal((30, 3))
    atlas = sphere_atlas(1.0, 16)
    for direction in directions:
        record, pose = record_of({2: [(direction, 1.0)]})
        [impulse] = record.impulses(*TOLD)
        away = np.linalg.norm(atlas.positions[impulse.texel] - in_frame(impulse.point[None], pose))
        # at the cube's corners texels are rhombi of 120 degrees: half the diagonal is 0.93 of the area's root
        assert away < 0.95 * np.sqrt(atlas.areas[impulse.texel])


def test_touches_have_the_force_weighted_point_and_normal_and_the_geoms_own_load() -> None:
    record, pose = record_of()
    touches = list(record.touches())
    assert [(touch.target, touch.other) for touch in touches] == [(0, 1), (0, 3)]
    for touch, contacts in zip(touches, EACH.values(), strict=True):
        forces = np.array([force for _, force in contacts])
        normals = np.array([np.array(normal) / np.linalg.norm(normal) for normal, _ in contacts])
        [local] = in_frame(touch.point[None], pose)
        np.testing.assert_allclose(local, 1.003 * forces @ normals / forces.sum(), atol=1e-12)
        mean = pose.rotation @ (forces @ normals)
        np.testing.assert_allclose(touch.normal, mean / np.linalg.norm(mean), atol=1e-12)
        assert touch.load.forces.sum() == pytest.approx(forces.sum())


def test_the_loads_of_all_touches_make_up_the_whole_load_while_geoms_strike() -> None:
    pose = tilted()
    load, record = sphere_load().touched(contacts_on(pose, EACH), pose, DT, 2 * DT)
    whole, parts = np.bincount(load.texels, load.forces, 1536), np.zeros(1536)
    for touch in record.touches():
        parts += np.bincount(touch.load.texels, touch.load.forces, 1536)
    np.testing.assert_allclose(parts, whole, rtol=1e-12)


def test_parts_of_one_flex_are_told_of_together_at_their_middle_on_the_surface() -> None:
    record, pose = record_of()
    names, owners = ["globe", "cloth"], np.array([0, 1, 1, 1])
    [impulse] = record.impulses(names, owners, sphere_atlas(1.0, 16), DT)
    assert (impulse.geom, impulse.other) == ("globe", "cloth")
    assert impulse.impulse == pytest.approx(8.0 * DT)
    [local] = in_frame(impulse.point[None], pose)
    places = [in_frame(each.point[None], pose)[0] for each in record.impulses(*TOLD)]
    middle = np.average(places, axis=0, weights=[5.0, 3.0])
    np.testing.assert_allclose(local, middle / np.linalg.norm(middle), atol=2e-3)
