"""Primitive geoms and height fields ripple on the surface with which they collide."""

import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import add_ball, forwarded, model_of

from ripple_sim.coupling import height_field_triangles, primitive_triangles, target_atlas
from ripple_sim.solver import AtlasError


def test_equal_geoms_share_one_atlas() -> None:
    kinds = ("sphere", "sphere", "ellipsoid", "ellipsoid")
    geoms = (
        f'<geom name="target {i}" type="{kind}" size="0.1 0.2 0.3"/>'
        for i, kind in enumerate(kinds)
    )
    model = model_of("".join(geoms))
    first, second, third, fourth = (
        target_atlas(model, model.geom(f"target {i}").id, 8) for i in range(4)
    )
    assert first is second
    assert third is fourth
    assert target_atlas(model, model.geom("target 0").id, 16) is not first


def test_error_about_a_mesh_without_charts_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As heaps of a thousand loose slivers, which covers of robots may be."""

    def refuse(*_: object, **__: object) -> None:
        raise AtlasError("3 triangles of the surface are too thin to be laid out flat")

    monkeypatch.setattr("ripple_sim.coupling.target_mesh.build_atlas", refuse)
    model = model_of('<body name="cover"><geom type="box" size="0.11 0.22 0.33"/></body>')
    with pytest.raises(
        AtlasError, match=r"geom 'cover/0', in 1 part, gets no charts: 3 triangles.*wrap=True"
    ):
        target_atlas(model, 0, 8)


def land(rows: int, columns: int) -> mujoco.MjSpec:
    heights = np.random.default_rng(4).uniform(0.3, 0.6, (rows, columns))
    heights[0, 0] = 0.0
    heights[-1, -1] = 1.0
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.001
    spec.add_hfield(
        name="land", nrow=rows, ncol=columns, size=[1.2, 0.8, 0.3, 0.1], userdata=heights.ravel()
    )
    kind = mujoco.mjtGeom.mjGEOM_HFIELD
    pos = [0.1, 0.2, 0.3]
    spec.worldbody.add_geom(name="land", type=kind, hfieldname="land", pos=pos, condim=1)
    return spec


def test_triangles_lie_where_mujocos_rays_meet_the_field_and_face_up() -> None:
    model = land(9, 12).compile()
    data = forwarded(model)
    V, F = height_field_triangles(model, 0)
    rng = np.random.default_rng(0)
    for corners in V[F[rng.permutation(len(F))[:60]]] + model.geom_pos[0]:
        point = rng.dirichlet([1.0] * 3) @ corners
        above = point + np.array([0, 0, 5.0])
        down = np.array([0, 0, -1.0])
        away = mujoco.mj_ray(model, data, above, down, None, 1, -1, np.zeros(1, np.int32))
        assert 5.0 - away == pytest.approx(0.0, abs=1e-6)
    assert (np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])[:, 2] > 0).all()


def test_a_ball_that_falls_on_land_gives_it_its_momentum() -> None:
    spec = land(9, 12)
    add_ball(spec, "ball", [0.3, 0.2, 1.0], condim=1)
    run = Run(spec, "land", density=20.0, resolution=16)
    lost = 0.0
    waves = run.ripples["land"]
    velocity = run.data.qvel[:3]
    assert waves.atlas.layout == "patches"
    while run.data.time < 0.5:
        before = velocity.copy()
        run.step()
        lost += 0.2 * np.linalg.norm(
            velocity - before - run.model.opt.gravity * run.model.opt.timestep
        )
    assert run.given() > 0.1
    assert run.given() == pytest.approx(lost, rel=0.01)
    assert waves.momentum() == pytest.approx(-run.given(), rel=0.01)


SOLIDS = [
    ("sphere", (0.2,)),
    ("ellipsoid", (0.3, 0.2, 0.1)),
    ("ellipsoid", (0.02, 0.5, 0.5)),
    ("capsule", (0.1, 0.2)),
    ("capsule", (0.2, 0.01)),
    ("cylinder", (0.2, 0.1)),
    ("cylinder", (0.05, 0.4)),
    ("box", (0.2, 0.3, 0.1)),
    ("box", (1.0, 1.0, 0.01)),
]
every_solid = pytest.mark.parametrize(("kind", "size"), SOLIDS)


def triangles(kind: str, size: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    return primitive_triangles(kind, np.array([*size, 0.0, 0.0][:3]))


def distances(kind: str, size: tuple[float, ...], points: np.ndarray) -> np.ndarray:
    """Signed distances from the exact solid [m]; for an ellipsoid in units of its own half-axes."""
    if kind in ("sphere", "ellipsoid"):
        return np.linalg.norm(points / np.resize(size, 3), axis=1) - 1
    around = np.linalg.norm(points[:, :2], axis=1)
    if kind == "capsule":
        along = np.maximum(np.abs(points[:, 2]) - size[1], 0)
        return np.hypot(around, along) - size[0]
    beyond = (
        np.abs(points) - size
        if kind == "box"
        else np.column_stack([around, np.abs(points[:, 2])]) - size
    )
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def mesh_of(kind: str, size: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.Trimesh(*triangles(kind, size), process=False, validate=False)


@every_solid
def test_short_edges_cover_the_exact_closed_surface_outwards(
    kind: str, size: tuple[float, ...]
) -> None:
    V, F = triangles(kind, size)
    np.testing.assert_allclose(distances(kind, size, V), 0, atol=1e-12)
    edges = np.linalg.norm(V[F] - V[np.roll(F, -1, axis=1)], axis=2)
    # moved outwards onto a round surface, an edge grows a little
    assert edges.max() <= 1.02 * np.ptp(V, axis=0).max() / 24
    assert (
        np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1).min() > 0
    )
    mesh = mesh_of(kind, size)
    mesh.merge_vertices()
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume > 0


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("box", (0.2, 0.3, 0.1), 0.88),
        ("capsule", (0.1, 0.2), np.pi * (0.08 + 0.04)),
        ("cylinder", (0.2, 0.1), np.pi * (0.08 + 0.08)),
        ("ellipsoid", (0.3, 0.3, 0.3), 4 * np.pi * 0.09),
    ],
)
def test_volume_area_and_moments_are_those_of_the_solid(
    kind: str, size: tuple[float, ...], area: float
) -> None:
    mesh = mesh_of(kind, size)
    assert mesh.area == pytest.approx(area, rel=3e-3)
    np.testing.assert_allclose(mesh.center_mass, 0, atol=1e-6)
    # MuJoCo's own inertia of the same solid, at a density of 1
    geom = f'<geom type="{kind}" size="{" ".join(map(str, size))}" density="1"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><freejoint/>{geom}</body></worldbody></mujoco>"
    )
    assert mesh.volume == pytest.approx(model.body_mass[1], rel=3e-3)
    np.testing.assert_allclose(
        np.sort(np.diag(mesh.moment_inertia)), np.sort(model.body_inertia[1]), rtol=6e-3
    )


@pytest.mark.parametrize("scale", [2.0**-17, 2.0**17])
@every_solid
def test_triangles_are_alike_at_every_scale(
    kind: str, size: tuple[float, ...], scale: float
) -> None:
    V, F = triangles(kind, size)
    scaled, same = triangles(kind, tuple(scale * x for x in size))
    np.testing.assert_array_equal(F, same)
    np.testing.assert_allclose(scaled, scale * V, rtol=0, atol=1e-12 * scale)
