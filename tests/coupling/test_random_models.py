"""Sixty random models: impulses are in place and as bodies feel them, or a warning says not."""

import warnings
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest
from momentum_balance import MomentumBalance
from random_hit import RandomHit
from random_models import RandomModel
from wave_heights import WaveHeights

from ripple_sim import Impulse, Material, Ripples, RippleWarning
from ripple_sim.solver.layouts import build

RESOLUTION = 16
TOLERANCE = 0.01
# as long as this the surface receives every force as it comes [s]
AT_ONCE = 0.1
# heights over the local radius, and slopes on a hundredth of the surface, that are warned of
HIGH = 0.25
STEEP = 1.0
STEEP_AREA = 0.01
# they are looked at once in 16 steps, and measured in another way here
SLACK = 1.5


class Hit:
    """A random model whose geoms meet: impulses, warnings and the height of the waves."""

    def __init__(self, seed: int) -> None:
        random = RandomModel(seed)
        scene = RandomHit(random)
        speed = 0.4 * random.size / RESOLUTION / random.timestep
        materials = {name: Material(speed=speed, density=1.0) for name in random.targets}
        steps = min(scene.steps, int(AT_ONCE / random.timestep))
        again = steps // 2 if random.restarted else None
        self.balance = MomentumBalance(scene.model, random.targets)
        with warnings.catch_warnings(
            record=True, action="always", category=RippleWarning
        ) as caught:
            options = {"resolution": RESOLUTION, "backend": "cpu", "conserve_volume": False}
            ripples = self.ripples = Ripples(scene.model, materials, **options)
            self.heights = {
                name: WaveHeights(ripples[name].atlas, SLACK * STEEP) for name in ripples
            }
            self.off = 0.0
            self.facing = 1.0
            with scene.filtering():
                for step in range(steps):
                    if step == again:
                        scene.restart()
                        self.balance = MomentumBalance(scene.model, random.targets)
                    self.balance.before(scene.data)
                    scene.step()
                    ripples.step(scene.data)
                    self.balance.after(scene.data, ripples.last_impulses)
                    for impulse in ripples.last_impulses:
                        self._look_at_place(scene.data, impulse, random.kind)
                    for name, each in self.heights.items():
                        each.look(ripples[name])
            self.momentum = {name: ripples[name].momentum() for name in ripples}
            self.finite = all(
                np.isfinite([ripples[name].height, ripples[name].velocity]).all()
                for name in ripples
            )
            ripples.reset()  # reports waves that are still followed
        told = [str(each.message) for each in caught]
        self.warned_high = {
            name
            for name in ripples
            if any(f"the waves on geom {name!r} are too" in x for x in told)
        }
        self.told = [text for text in told if "the waves on geom" not in text]

    def _look_at_place(self, data: mujoco.MjData, impulse: Impulse, kind: str) -> None:
        """Distance of an impulse from the surface over its size, and whether it pushes apart."""
        waves = self.ripples[impulse.geom]
        atlas = waves.atlas
        rotation = data.geom(impulse.geom).xmat.reshape(3, 3)
        local = waves.from_world(impulse.point, data)
        off = np.linalg.norm(atlas.project(local)[0][0] - local)
        self.off = max(self.off, off / np.ptp(atlas.mesh.V, axis=0).max())
        pair = impulse.geom, impulse.other
        push = self.balance.pushes[pair]
        pressed = sum(
            each.impulse for each in self.ripples.last_impulses if (each.geom, each.other) == pair
        )
        strength = float(np.linalg.norm(push))
        # contacts with a flex or a coarse signed distance push sideways too, and hills from several
        # sides
        types = [data.model.geom(name).type[0] for name in (impulse.geom, impulse.other)]
        # and the normal of geoms that MuJoCo pairs a hair before they touch may be any
        contact = data.contact
        pair_id = [data.geom(name).id for name in (impulse.geom, impulse.other)]
        touching = (
            np.isin(contact.geom, pair_id).all(axis=1) & (contact.dist < contact.includemargin)
        ).any()
        straight = touching and kind != "flex" and mujoco.mjtGeom.mjGEOM_SDF not in types
        if straight and strength * data.model.opt.timestep > 0.99 * pressed > 0:
            self.facing = min(
                self.facing, rotation @ atlas.normals[impulse.texel] @ push / strength
            )


@pytest.fixture(scope="module")
def _one_sphere_map_a_shape() -> Iterator[None]:
    """Meshes that differ in size alone share a sphere map, the dearest part of small atlases."""
    known: dict[tuple[str, bytes, bytes], np.ndarray] = {}

    def shared(name: str, sphere_map: Callable) -> Callable:
        def of_shape(V: np.ndarray, F: np.ndarray) -> np.ndarray:
            shape = np.round((V - V.mean(axis=0)) / np.ptp(V, axis=0).max(), 4) + 0.0
            key = name, shape.tobytes(), F.tobytes()
            if key not in known:
                # the map of the rounded shape, so that results do not depend on the order of sizes
                known[key] = sphere_map(shape, F)
            return known[key]

        return of_shape

    with pytest.MonkeyPatch.context() as patch:
        for name, sphere_map in build.SPHERE_MAPS.items():
            patch.setitem(build.SPHERE_MAPS, name, shared(name, sphere_map))
        yield


@pytest.mark.usefixtures("_one_sphere_map_a_shape", "in_tmp_path")
@pytest.mark.parametrize("block", range(3))
def test_impulses_are_the_change_of_momentum_and_waves_are_low_unless_warned(
    block: int,
) -> None:
    touched = 0
    for seed in range(20 * block, 20 * block + 20):
        hit = Hit(seed)
        assert hit.finite, seed
        assert hit.off < 1e-9, seed
        assert hit.told or hit.facing > 0, seed
        for name in hit.ripples:
            if name not in hit.warned_high:
                assert hit.heights[name].highest <= SLACK * HIGH, (seed, name)
                assert hit.heights[name].steepest <= SLACK * STEEP_AREA, (seed, name)
            pairs = [pair for (target, _), pair in hit.balance.pairs.items() if target == name]
            exchanged = sum(pair.exchanged for pair in pairs)
            if hit.told or not exchanged:
                continue
            touched += 1
            given = sum(pair.given for pair in pairs)
            limit = TOLERANCE * exchanged
            assert given == pytest.approx(sum(pair.reported for pair in pairs), abs=limit), (
                seed,
                name,
            )
            assert sum(abs(pair.felt - pair.reported) for pair in pairs) <= limit, (seed, name)
            assert hit.momentum[name] == pytest.approx(-given, abs=limit), (seed, name)
    assert touched >= 5
