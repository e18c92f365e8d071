"""All bodies on a target at once: the same as each of them alone."""

import mujoco
import numpy as np
import pytest

from ripple_sim import Material, Ripples
from ripple_sim.coupling.contacts.geom_contacts import Contacts
from ripple_sim.coupling.load.footprint_cache import NO_FOOTPRINTS, Footprints, lay, used_before
from ripple_sim.coupling.load.low_pass import BODY, NOTHING_FELT, Pressure, follow
from ripple_sim.coupling.patches.clusters import probe, spread
from ripple_sim.coupling.patches.contact_patches import Spots, find_patches, find_spots
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.footprint import footprint
from ripple_sim.solver.waves.load import slot_scratch

RADII, CONVEX = np.array([0.5, 0.04, 0.06, 0.03, 0.05]), np.array([True, True, False, True, True])


@pytest.fixture(scope="module")
def block() -> Atlas:
    """A cube of 1 m, cut into triangles."""
    import trimesh

    solid = trimesh.creation.box(extents=(1, 1, 1)).subdivide_to_size(0.2)
    return build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)


def random_contacts(seed: int) -> tuple[Contacts, np.ndarray, np.ndarray]:
    """Contacts of four bodies with the upper side of a cube, which stands somewhere in the world."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 6, 4)
    counts[rng.integers(4)] = 1
    begins = np.concatenate([[0], np.cumsum(counts)])
    local = np.column_stack([rng.uniform(-0.4, 0.4, (begins[-1], 2)), rng.uniform(0.5, 0.501, begins[-1])])
    position, rotation = rng.standard_normal(3), np.linalg.qr(rng.standard_normal((3, 3)))[0]
    points, forces = position + local @ rotation.T, rng.uniform(0.1, 3.0, begins[-1])
    contacts = Contacts(0, np.arange(1, 5), begins, points, forces, np.tile(rotation[:, 2], (len(points), 1)))
    return contacts, position, rotation


@pytest.mark.parametrize("seed", range(6))
def test_packed_patches_are_those_of_each_body(block: Atlas, seed: int) -> None:
    contacts, position, rotation = random_contacts(seed)
    patches = find_patches(contacts, position, rotation, RADII, CONVEX)
    surface, texels = block.nearest(patches.points)
    spots = find_spots(contacts.others, patches, surface, texels, 0.5)
    for i, other in enumerate(contacts.others):
        rows, mine = slice(*contacts.begins[i : i + 2]), slice(*spots.begins[i : i + 2])
        points, forces = (contacts.points[rows] - position) @ rotation, contacts.forces[rows]
        middle = patches.points[patches.begins[i]]
        np.testing.assert_allclose(middle, forces @ points / forces.sum(), atol=1e-12)
        assert patches.forces[i] == pytest.approx(forces.sum())
        loads, probes = probe(points, forces, RADII[other], CONVEX[other])
        at, pressing, radius, known = spread(0.5 * loads, probes, block.project(probes)[0], RADII[other])
        assert (spots.bodies[mine] == other).all()
        np.testing.assert_allclose(spots.points[mine], at, atol=1e-12)
        np.testing.assert_allclose(spots.forces[mine], pressing, rtol=1e-9)
        np.testing.assert_allclose(spots.radii[mine], radius)
        assert spots.forces[mine].sum() == pytest.approx(forces.sum() / 2), "half of the force was asked for"
        assert ((spots.texels[mine] >= 0) == (known >= 0)).all()
    seen = spots.texels >= 0
    assert seen.any()
    places, nearest = block.nearest(spots.points[seen])
    np.testing.assert_allclose(spots.places[seen], places, atol=1e-12)
    np.testing.assert_array_equal(spots.texels[seen], nearest)


def spots_at(atlas: Atlas, bodies: list[int], points: np.ndarray, radius: float) -> Spots:
    places, texels = atlas.nearest(points)
    begins = np.concatenate([[0], np.flatnonzero(np.diff(bodies)) + 1, [len(bodies)]])
    forces, radii = np.ones(len(bodies)), np.full(len(bodies), radius)
    return Spots(begins, np.array(bodies), points, forces, radii, places, texels)


def laid(atlas: Atlas, known: Footprints, spots: Spots, here: list[int]) -> tuple[Footprints, np.ndarray]:
    states = np.zeros(5, BODY)
    states["here"][here] = True
    rows, lost = used_before(known, spots, states)
    assert not len(lost), "all places are known"
    carried, scratch = atlas.areas.reshape(-1), distance_scratch(atlas.areas.size)
    return lay(known, spots, rows, atlas.texels.grid, carried, scratch), rows


def test_footprints_are_used_again_where_a_spot_stays_and_kept_while_its_body_is_here() -> None:
    animal = build_atlas(Mesh.from_arrays(*limbed(0.05)), 24, cache=False)
    rng = np.random.default_rng(2)
    points = animal.mesh.V[rng.integers(0, len(animal.mesh.V), 60)]
    bodies = sorted(rng.integers(1, 5, 60).tolist())
    first, rows = laid(animal, NO_FOOTPRINTS, spots_at(animal, bodies, points, 0.08), [])
    assert (rows < 0).all()
    areas = animal.areas.reshape(-1)
    for i, point in enumerate(points):
        where, mine = footprint(animal, point, 0.08), slice(*first.begins[i : i + 2])
        np.testing.assert_array_equal(first.texels[mine], where.texels)
        np.testing.assert_allclose(first.shares[mine], where.weights * areas[where.texels])
        assert first.shares[mine].sum() == pytest.approx(1.0)
    # body 1 has gone for good, 2 has only lost touch; of the others every second spot has moved on
    on = np.array(bodies) > 2
    moved = points[on].copy()
    moved[::2] += 10 * first.tolerances[on][::2, None] * [1.0, 0, 0]
    second, rows = laid(animal, first, spots_at(animal, np.array(bodies)[on].tolist(), moved, 0.08), [2, 3, 4])
    assert (rows[: on.sum()][::2] != np.flatnonzero(on)[::2]).all()
    np.testing.assert_array_equal(first.points[rows[: on.sum()]][1::2], points[on][1::2])
    np.testing.assert_array_equal(rows[on.sum() :], np.flatnonzero(np.array(bodies) == 2))
    kept = slice(second.begins[on.sum()], None)
    old = slice(first.begins[bodies.index(2)], first.begins[bodies.index(3)])
    np.testing.assert_array_equal(second.texels[kept], first.texels[old])
    np.testing.assert_array_equal(second.shares[kept], first.shares[old])


def pressure_of(bodies: list[int], texels: list[np.ndarray], forces: list[np.ndarray]) -> Pressure:
    """Bodies that press on eight texels each, and stay in their places."""
    begins, middles = 8 * np.arange(len(bodies) + 1), np.zeros((len(bodies), 3))
    at, loads = np.array(texels, np.int64).reshape(-1), np.array(forces, np.float64).reshape(-1)
    return Pressure(np.array(bodies, np.int64), middles, np.full(len(bodies), 0.05), begins, at, loads)


def test_bodies_are_smoothed_each_for_itself() -> None:
    """Three bodies that come and go, together and alone."""
    size, dt, rng = 96, 0.002, np.random.default_rng(3)
    alone = [(np.zeros(4, BODY), NOTHING_FELT) for _ in range(4)]
    states, felt, over = np.zeros(4, BODY), NOTHING_FELT, True
    for step in range(400):
        present = [g for g in range(1, 4) if rng.random() < (0.9, 0.5, 0.02)[g - 1] and step < 200]
        texels = [rng.permutation(8) + 10 * g for g in present]
        forces = [rng.exponential(1.0, 8) for _ in present]
        pressure = pressure_of(present, texels, forces)
        felt, given, over = follow(states, felt, pressure, dt, slot_scratch(size))
        together, apart = np.bincount(felt.texels, given, size), np.zeros(size)
        for g in range(1, 4):
            mine = slice(present.index(g), present.index(g) + 1) if g in present else slice(0, 0)
            mine = pressure_of(present[mine], texels[mine], forces[mine])
            own, out, _ = follow(alone[g][0], alone[g][1], mine, dt, slot_scratch(size))
            alone[g] = alone[g][0], own
            apart += np.bincount(own.texels, out, size)
        np.testing.assert_array_equal(together, apart)
        assert over == (not states["here"].any())
    assert over


def test_a_target_is_pressed_alike_whether_others_ripple_or_not() -> None:
    """Three targets and bodies on all of them: those that ripple with others have the same waves, bit for bit."""
    rng = np.random.default_rng(4)
    targets = "".join(
        f'<geom name="{name}" type="box" size="0.3 0.3 0.05" pos="{x} 0 0"/>'
        for name, x in (("left", -0.7), ("middle", 0.0), ("right", 0.7))
    )
    bodies = "".join(
        f'<body pos="{0.7 * (i % 3 - 1) + x:.3f} {y:.3f} {0.1 + 0.02 * i:.3f}"><freejoint/>'
        f'<geom type="{("sphere", "box", "capsule")[i // 3]}" size="0.04 0.04 0.04"/></body>'
        for i, (x, y) in enumerate(rng.uniform(-0.2, 0.2, (9, 2)))
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{targets}{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    names = ("left", "middle", "right")
    options = {"resolution": 16, "backend": "cpu"}
    together = Ripples(model, {name: Material() for name in names}, **options)
    alone = {name: Ripples(model, {name: Material()}, **options) for name in names}
    most = 0
    for _ in range(200):
        mujoco.mj_step(model, data)
        together.step(data)
        for ripples in alone.values():
            ripples.step(data)
        assert [(each.geom, each.other) for each in together.last_impulses] == [
            (each.geom, each.other) for ripples in alone.values() for each in ripples.last_impulses
        ]
        most = max(most, len(together.last_impulses))
    assert most > 6
    for name in names:
        assert together[name].height.any()
        np.testing.assert_array_equal(together[name].height, alone[name][name].height)
