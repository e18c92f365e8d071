"""Primitive geoms ripple on their own surface."""

import numpy as np
import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, Ripples
from ripple_sim.coupling.target_mesh import target_atlas


@pytest.mark.parametrize(
    ("kind", "size", "volume", "half_extents"),
    [
        ("box", (0.2, 0.3, 0.1), 8 * 0.006, (0.2, 0.3, 0.1)),
        ("capsule", (0.1, 0.2), np.pi * 0.01 * (0.4 + 0.4 / 3), (0.1, 0.1, 0.3)),
        ("cylinder", (0.2, 0.1), 2 * np.pi * 0.004, (0.2, 0.2, 0.1)),
        ("ellipsoid", (0.3, 0.2, 0.1), 4 / 3 * np.pi * 0.006, (0.3, 0.2, 0.1)),
    ],
)
def test_primitives_ripple_on_their_own_surface(
    kind: str, size: tuple[float, ...], volume: float, half_extents: tuple[float, ...]
) -> None:
    numbers = " ".join(map(str, size))
    model = model_of(f'<geom name="target" type="{kind}" size="{numbers}"/>' + BALL.format("0 0 2"))
    mesh = Ripples(model, {"target": Material()}, resolution=24, backend="cpu")["target"].atlas.mesh
    assert mesh.volume == pytest.approx(volume, rel=0.005)
    np.testing.assert_allclose(mesh.V.max(axis=0), half_extents, rtol=0.01)
    np.testing.assert_allclose(mesh.V.min(axis=0), np.negative(half_extents), rtol=0.01)


def test_equal_geoms_share_one_atlas_whatever_their_names() -> None:
    kinds = ("sphere", "sphere", "ellipsoid", "ellipsoid")
    geoms = (f'<geom name="target {i}" type="{kind}" size="0.1 0.2 0.3"/>' for i, kind in enumerate(kinds))
    model = model_of("".join(geoms))
    first, second, third, fourth = (target_atlas(model, model.geom(f"target {i}").id, 8) for i in range(4))
    assert first is second
    assert third is fourth
    assert target_atlas(model, model.geom("target 0").id, 16) is not first
