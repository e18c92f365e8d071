"""The rest filter: forces pass as they are, places and chatter are averaged, and no impulse is lost."""

import numpy as np
import pytest

from ripple_sim.coupling.rest_filter import NO_FORCES, RestFilter, TexelForces
from ripple_sim.solver import Load, sphere_atlas
from ripple_sim.solver.waves.footprint import footprint


class LoadedSphere:
    """A sphere of 1 m under the load of one geom, geom 0."""

    def __init__(self, resolution: int, radius: float, dt: float) -> None:
        self.atlas, self.radius, self.dt = sphere_atlas(1.0, resolution), radius, dt
        self.filter = RestFilter(1, self.atlas.areas.size)

    def at(self, point: np.ndarray, force: float) -> Load:
        where = footprint(self.atlas, point, self.radius)
        forces = force * where.weights * self.atlas.areas.reshape(-1)[where.texels]
        rows = np.array([0, len(forces)])
        present = TexelForces(
            np.zeros(1, np.int64), point[None], np.array([self.radius / 2]), rows, where.texels, forces
        )
        return self.filter(present, self.dt)


def given_over_time(forces: np.ndarray, dt: float) -> np.ndarray:
    """Force that the surface receives in each step, while a geom touches and for a second after."""
    sphere, given = LoadedSphere(16, 0.3, dt), []
    for force in np.concatenate([forces, np.zeros(round(1.0 / dt))]):
        out = sphere.at(np.array([0.0, 0.0, 1.0]), force) if force > 0 else sphere.filter(NO_FORCES, dt)
        given.append(out.forces.sum())
    assert not sphere.filter.active.any()
    return np.array(given)


def test_hits_pass_as_they_are() -> None:
    dt = 0.002
    hit = 50 * np.sin(np.pi * np.arange(1, 20) / 20)
    given = given_over_time(hit, dt)
    np.testing.assert_allclose(given[: len(hit)], hit, rtol=1e-12)
    assert not given[len(hit) :].any()


@pytest.mark.parametrize("kind", ["steady", "driven", "noise", "hit"])
def test_the_force_of_unbroken_contact_passes_as_it_is(kind: str) -> None:
    dt, steps = 0.002, 2000
    force = np.full(steps, 3.0)
    if kind == "driven":
        force += 2.9 * np.sin(2 * np.pi * 5.0 * dt * np.arange(steps))
    elif kind == "noise":
        force = np.random.default_rng(0).exponential(3.0, steps)
    elif kind == "hit":
        force[1500:1510] += 300.0
    given = given_over_time(force, dt)
    np.testing.assert_allclose(given[:steps], force, rtol=1e-9)
    assert np.abs(given[steps:]).max() < 1e-9


# openings of a step, after two to five of contact
CHATTER = {"each other step": (0, 6), "sixth": (1.5, 4.4, 4.2, 3.5, 2.9, 0), "third": (0, 6, 4)}


@pytest.mark.parametrize(
    ("kind", "dt"),
    [("each other step", 0.004), ("third", 0.004), *((kind, dt) for kind in CHATTER for dt in (0.0005, 0.002))],
)
def test_nothing_of_chatter_is_lost_and_it_is_averaged(kind: str, dt: float) -> None:
    steps = round(6.0 / dt)
    force = np.resize(CHATTER[kind], steps).astype(np.float64)
    given = given_over_time(force, dt)
    assert given.sum() == pytest.approx(force.sum(), rel=1e-9)
    late = given[steps - 500 : steps]
    assert late.std() < 0.2 * force.std()
    assert late.mean() == pytest.approx(force.mean(), rel=0.02)
    assert np.abs(given[steps:]).max() < force.max()


def test_a_hit_on_a_chattering_geom_passes() -> None:
    dt, steps = 0.002, 2500
    force = np.resize([0.0, 6.0, 4.0], steps)
    hit = np.zeros(steps)
    hit[2000:2006] = [100, 300, 500, 500, 300, 100]
    given = given_over_time(force + hit, dt)
    assert given.sum() == pytest.approx((force + hit).sum(), rel=1e-9)
    passed = given - given_over_time(force, dt)
    assert passed[2000:2007].sum() == pytest.approx(hit.sum(), rel=0.05)
    assert np.abs(passed[2020:2500]).max() < 0.01 * hit.max()


def test_the_place_of_a_geom_at_rest_is_averaged() -> None:
    """Its weight jumps between two points, which a hit does not wait for."""
    sphere, rng, given = LoadedSphere(32, 0.2, 0.002), np.random.default_rng(1), []
    for step in range(2000):
        angle = 0.04 * rng.integers(2)
        load = sphere.at(np.array([np.sin(angle), 0.0, np.cos(angle)]), 3.0 if step < 1990 else 300.0)
        given.append(np.bincount(load.texels, load.forces, sphere.atlas.areas.size))
    given = np.array(given)
    change = np.abs(np.diff(given, axis=0)).sum(axis=1)
    assert change[1500:1988].max() < 0.01 * change[:30].max()
    assert change[1990:].max() > 50 * change[:30].max()


@pytest.mark.parametrize("speed", [0.5, 5.0])
def test_a_geom_that_moves_on_loads_the_surface_where_it_is(speed: float) -> None:
    """It has rested for a while."""
    sphere, dt = LoadedSphere(32, 0.2, 0.002), 0.002
    for step in range(1500):
        angle = max(0.0, speed * (step - 1000) * dt)
        point = np.array([np.sin(angle), 0.0, np.cos(angle)])
        load = sphere.at(point, 2.0)
        if step * dt < 2 or step * dt > 2.15:
            middle = load.forces @ sphere.atlas.positions.reshape(-1, 3)[load.texels] / load.forces.sum()
            assert np.linalg.norm(middle - point) < 0.1


def forces_of(geoms: list[int], texels: list[np.ndarray], forces: list[np.ndarray]) -> TexelForces:
    """Geoms that load eight texels each, and stay in their places."""
    begins, middles = 8 * np.arange(len(geoms) + 1), np.zeros((len(geoms), 3))
    at, loads = np.array(texels, np.int64).reshape(-1), np.array(forces, np.float64).reshape(-1)
    return TexelForces(np.array(geoms, np.int64), middles, np.full(len(geoms), 0.05), begins, at, loads)


def test_geoms_are_filtered_each_for_itself() -> None:
    """Three geoms that come and go, together and alone."""
    size, dt, rng = 96, 0.002, np.random.default_rng(3)
    alone, every = [RestFilter(4, size) for _ in range(4)], RestFilter(4, size)
    for step in range(400):
        present = [g for g in range(1, 4) if rng.random() < (0.9, 0.5, 0.02)[g - 1] and step < 200]
        texels = [rng.permutation(8) + 10 * g for g in present]
        forces = [rng.exponential(1.0, 8) for _ in present]
        load = every(forces_of(present, texels, forces), dt)
        together, apart = np.bincount(load.texels, load.forces, size), np.zeros(size)
        for g in range(1, 4):
            mine = slice(present.index(g), present.index(g) + 1) if g in present else slice(0, 0)
            own = alone[g](forces_of(present[mine], texels[mine], forces[mine]), dt)
            apart += np.bincount(own.texels, own.forces, size)
        np.testing.assert_array_equal(together, apart)
    assert not every.active.any()
    assert not len(every(NO_FORCES, dt).texels)
