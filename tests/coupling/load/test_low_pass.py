"""The low-pass filter: hits pass as they are, noise is averaged, and no impulse is lost."""

import numpy as np
import pytest

from ripple_sim.coupling.load.low_pass import CONTACT_STATE, ONSET, low_pass
from ripple_sim.coupling.load.texel_forces import NO_FILTERED_FORCES, NO_FORCES, TexelForces
from ripple_sim.solver import Load, sphere_atlas
from ripple_sim.solver.waves.footprint import footprint
from ripple_sim.solver.waves.load import slot_scratch


class LoadedSphere:
    """A sphere of 1 m under the load of one geom, geom 0."""

    def __init__(self, resolution: int, radius: float, dt: float) -> None:
        self.atlas, self.radius, self.dt = sphere_atlas(1.0, resolution), radius, dt
        self.states, self.filtered, self.over = np.zeros(1, CONTACT_STATE), NO_FILTERED_FORCES, True

    def at(self, point: np.ndarray, force: float) -> Load:
        where = footprint(self.atlas, point, self.radius)
        forces = force * where.weights * self.atlas.areas.reshape(-1)[where.texels]
        rows = np.array([0, len(forces)])
        return self.filter(
            TexelForces(np.zeros(1, np.int64), point[None], np.array([self.radius / 2]), rows, where.texels, forces)
        )

    def filter(self, present: TexelForces) -> Load:
        scratch = slot_scratch(self.atlas.areas.size)
        self.filtered, given, self.over = low_pass(self.states, self.filtered, present, self.dt, scratch)
        return Load(self.filtered.texels, given)


def given_over_time(forces: np.ndarray, dt: float) -> np.ndarray:
    """Force that the surface receives in each step, while a geom touches and for a second after."""
    sphere, given = LoadedSphere(16, 0.3, dt), []
    for force in np.concatenate([forces, np.zeros(round(1.0 / dt))]):
        out = sphere.at(np.array([0.0, 0.0, 1.0]), force) if force > 0 else sphere.filter(NO_FORCES)
        given.append(out.forces.sum())
    assert sphere.over
    assert not len(sphere.filtered.texels)
    return np.array(given)


def test_hits_pass_as_they_are() -> None:
    dt = 0.002
    hit = 50 * np.sin(np.pi * np.arange(1, 20) / 20)
    given = given_over_time(hit, dt)
    np.testing.assert_allclose(given[: len(hit)], hit, rtol=1e-12)
    assert not given[len(hit) :].any()


@pytest.mark.parametrize("kind", ["steady", "flicker", "noise"])
def test_nothing_of_a_long_contact_is_lost_and_noise_is_averaged(kind: str) -> None:
    dt, steps = 0.002, 2000
    weight = np.full(steps, 3.0)
    if kind == "flicker":
        weight = np.where(np.arange(steps) % 2, 6.0, 0.0)
    elif kind == "noise":
        weight = np.random.default_rng(0).exponential(3.0, steps)
    given = given_over_time(weight, dt)
    assert given.sum() == pytest.approx(weight.sum(), rel=1e-6)
    late = given[steps - 500 : steps]
    assert late.std() < 0.05 * max(weight[-500:].std(), 1e-9)
    assert late.mean() == pytest.approx(3.0, rel=0.1)
    assert np.abs(given[steps + round(0.05 / dt) :]).max() < 3.0 * 0.5, "the geom has gone, its weight has not"


def test_steady_weight_passes_at_once() -> None:
    given = given_over_time(np.full(1000, 3.0), 0.002)
    np.testing.assert_allclose(given[:1000], 3.0, rtol=1e-9)


def test_a_sliding_geom_loads_the_surface_where_it_is() -> None:
    sphere = LoadedSphere(32, 0.2, 0.002)
    for step in range(1500):
        angle = 0.5 * step * 0.002
        point = np.array([np.sin(angle), 0.0, np.cos(angle)])
        load = sphere.at(point, 2.0)
        if step * 0.002 > ONSET:
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
    alone = [(np.zeros(4, CONTACT_STATE), NO_FILTERED_FORCES) for _ in range(4)]
    states, filtered, over = np.zeros(4, CONTACT_STATE), NO_FILTERED_FORCES, True
    for step in range(400):
        present = [g for g in range(1, 4) if rng.random() < (0.9, 0.5, 0.02)[g - 1] and step < 200]
        texels = [rng.permutation(8) + 10 * g for g in present]
        forces = [rng.exponential(1.0, 8) for _ in present]
        forces_now = forces_of(present, texels, forces)
        filtered, given, over = low_pass(states, filtered, forces_now, dt, slot_scratch(size))
        together, apart = np.bincount(filtered.texels, given, size), np.zeros(size)
        for g in range(1, 4):
            mine = slice(present.index(g), present.index(g) + 1) if g in present else slice(0, 0)
            mine = forces_of(present[mine], texels[mine], forces[mine])
            own, out, _ = low_pass(alone[g][0], alone[g][1], mine, dt, slot_scratch(size))
            alone[g] = alone[g][0], own
            apart += np.bincount(own.texels, out, size)
        np.testing.assert_array_equal(together, apart)
        assert over == (not states["active"].any())
    assert over
