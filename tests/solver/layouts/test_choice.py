"""The default layout is the cube for round bodies and patches for limbed ones."""

from pathlib import Path

import numpy as np
import pytest
from eigenvalues import errors_against, of_polyhedron
from genus_zero import icosphere, stretched, thin_limb

from ripple_sim.scenes.shapes import (
    DUCK_FILE,
    LIMBED_FILE,
    capsule,
    polygonise,
    smooth_union,
    sphere,
)
from ripple_sim.solver import Atlas, AtlasError, Mesh, MeshError, build_atlas, load_atlas, load_mesh
from ripple_sim.solver.layouts import build
from ripple_sim.solver.layouts.choice import LONGEST_TEXEL, elongation, texel_length


@pytest.fixture(scope="module")
def crab() -> Mesh:
    """A ball with four thin legs."""
    feet = ((0.7, 0.4, 0.0), (0.7, -0.4, 0.0), (-0.7, 0.4, 0.0), (-0.7, -0.4, 0.0))
    solid = smooth_union(
        0.05, sphere((0, 0, 0), 0.25), *(capsule((0, 0, 0), foot, 0.07) for foot in feet)
    )
    return Mesh.from_arrays(*polygonise(solid, ((-0.8, -0.5, -0.3), (0.8, 0.5, 0.3)), 0.04))


@pytest.fixture(scope="module")
def crab_atlas(crab: Mesh) -> Atlas:
    return build_atlas(crab, 32, cache=False)


def test_elongation_is_the_ratio_of_the_singular_values() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(50, 3, 3))
    places = rng.normal(size=(50, 3, 2))
    for k in range(50):
        sides = corners[k, 1:] - corners[k, 0]
        flat = places[k, 1:] - places[k, 0]
        large, small = np.linalg.svd(np.linalg.solve(flat, sides), compute_uv=False)
        assert elongation(corners[k : k + 1], places[k : k + 1])[0] == pytest.approx(
            large / small, rel=1e-9
        )


def test_a_triangle_without_area_is_not_long() -> None:
    line = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    square = np.array([[[0.0, 0], [1, 0], [0, 1]]])
    assert elongation(line, square)[0] == 1
    assert elongation(line[..., [1, 0, 2]], 0 * square)[0] == 1


def test_texels_of_a_sphere_are_as_long_as_those_of_an_equiangular_cube() -> None:
    # at the corners of the cube lines cross at 120 degrees, which makes a circle an ellipse of 1.73
    V, F = icosphere(4)
    assert 1.5 < texel_length(Mesh.from_arrays(V, F), V) < np.sqrt(3)


def test_length_does_not_depend_on_how_a_mesh_is_cut_or_scaled() -> None:
    V, F = icosphere(3)
    fine_V, fine_F = icosphere(5)
    squash = np.array([1.0, 1.0, 0.2])
    coarse = texel_length(Mesh.from_arrays(V * squash, F), V)
    assert texel_length(Mesh.from_arrays(40 * fine_V * squash, fine_F), fine_V) == pytest.approx(
        coarse, rel=0.05
    )


@pytest.mark.parametrize(
    "mesh",
    [
        lambda: Mesh.from_arrays(*icosphere(3)),
        lambda: Mesh.from_arrays(*stretched([1, 1, 0.3])),
        lambda: load_mesh(DUCK_FILE),
        lambda: load_mesh(LIMBED_FILE),
    ],
    ids=["ball", "pebble", "duck", "limbed"],
)
def test_round_bodies_and_shipped_ones_get_the_cube(mesh) -> None:
    atlas = build_atlas(mesh(), 8, cache=False)
    assert (atlas.layout, atlas.notes) == ("cube", ())
    assert texel_length(atlas.mesh, atlas.sphere) < 0.9 * LONGEST_TEXEL


def test_limbs_get_patches_with_a_reason_in_the_notes(crab: Mesh, crab_atlas: Atlas) -> None:
    assert crab_atlas.layout == "patches"
    [note] = crab_atlas.notes
    assert "times as long as wide" in note
    assert build_atlas(Mesh.from_arrays(*thin_limb(3, 0.1)), 8, cache=False).layout == "patches"
    cube = build_atlas(crab, 8, cache=False, layout="cube")
    assert cube.layout == "cube"
    assert cube.notes == ()


def test_the_lowest_modes_in_which_limbs_swing_are_more_exact(
    crab: Mesh, crab_atlas: Atlas
) -> None:
    exact = of_polyhedron(crab, 0)
    cube = build_atlas(crab, 32, cache=False, layout="cube")
    assert errors_against(exact, crab_atlas)[:4].max() < 0.3 * errors_against(exact, cube)[:4].max()


def test_the_choice_is_kept_in_the_cache(
    crab: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    # other layouts of the same mesh do not decide it
    build_atlas(crab, 8, layout="cube")
    first = build_atlas(crab, 8)
    assert first.layout == "patches"
    assert {"sphere_map", "patch_map"} <= first.timings.keys()
    monkeypatch.setitem(
        build.SPHERE_MAPS, "progressive", lambda V, F: pytest.fail("the sphere map is asked again")
    )
    again = build_atlas(crab, 8)
    assert again.timings.keys() == {"cache"}
    assert again.notes == first.notes
    np.testing.assert_array_equal(again.positions, first.positions)


def test_a_mesh_without_patches_gets_the_cube_with_a_note(
    crab: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> Atlas:
        raise AtlasError("3 triangles are too thin")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(build, "patch_atlas", fail)
    for expected in ("rays", "cache"):
        atlas = build_atlas(crab, 8)
        assert expected in atlas.timings
        assert atlas.layout == "cube"
        assert atlas.notes[0].endswith("since patches fail: 3 triangles are too thin")


def test_notes_are_saved(crab_atlas: Atlas, tmp_path: Path) -> None:
    crab_atlas.save(tmp_path / "crab.npz")
    assert load_atlas(tmp_path / "crab.npz").notes == crab_atlas.notes


def test_a_given_sphere_map_makes_a_cube_layout(crab: Mesh) -> None:
    known = build_atlas(crab, 8, cache=False, layout="cube").sphere
    assert build_atlas(crab, 8, cache=False, sphere=known).layout == "cube"


def test_a_named_cube_that_does_not_fit_is_refused() -> None:
    V, F = icosphere(1)
    with pytest.raises(MeshError, match="open"):
        build_atlas(Mesh.from_arrays(V, F[1:]), 8, cache=False, layout="cube")
