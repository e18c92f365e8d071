"""The shipped sphere maps: one for each target that needs one, and of that mesh alone."""

import dataclasses

import numpy as np
import pytest

from ripple_sim.coupling import TARGET_TYPES, find_geom, find_target, is_geom, target_atlas
from ripple_sim.coupling.target_mesh import target_mesh
from ripple_sim.scene import load_scene, shipped_scenes
from ripple_sim.scenes.sphere_maps import FOLDER, shipped_sphere_map, sphere_map_path
from ripple_sim.solver import Mesh
from ripple_sim.solver.layouts.sphere_map import certify, progressive_sphere_map, stretch


@pytest.fixture(scope="module")
def meshes() -> list[Mesh]:
    """The shipped targets that are closed, one part and of genus 0, and no spheres."""
    found = []
    for name in shipped_scenes():
        scene = load_scene(name)
        for target in scene.targets:
            geom = find_target(scene.model, target.geom)
            if not is_geom(geom, scene.model):
                continue
            mesh = target_mesh(scene.model, geom)
            if (
                mesh.closed
                and mesh.genus.tolist() == [0]
                and TARGET_TYPES[scene.model.geom_type[geom]] != "sphere"
            ):
                found.append(mesh)
    return found


def test_every_cube_target_has_a_stored_sphere_map(
    meshes: list[Mesh],
) -> None:
    assert {sphere_map_path(mesh) for mesh in meshes} == set(FOLDER.glob("*.npy"))


def test_stored_sphere_maps_are_certified(meshes: list[Mesh]) -> None:
    for mesh in meshes:
        assert certify(mesh.F, shipped_sphere_map(mesh)).valid


def test_stored_sphere_maps_equal_newly_built_maps(meshes: list[Mesh]) -> None:
    # they may differ in round-off, and so in their vertices, but not in how evenly they spread the
    # area
    mesh = min(meshes, key=lambda mesh: len(mesh.V))
    maps = shipped_sphere_map(mesh), progressive_sphere_map(mesh.V, mesh.F)
    shipped, made = (np.std(stretch(mesh.V, mesh.F, each)) for each in maps)
    assert shipped == pytest.approx(made, rel=0.02)


def test_a_changed_mesh_has_no_stored_sphere_map(meshes: list[Mesh]) -> None:
    V = meshes[0].V.copy()
    V[0] += 1e-6
    assert shipped_sphere_map(dataclasses.replace(meshes[0], V=V)) is None


def test_a_shipped_scene_uses_its_stored_sphere_map() -> None:
    scene = load_scene("animal")
    geom = find_geom(scene.model, scene.targets[0].geom)
    shipped = shipped_sphere_map(target_mesh(scene.model, geom))
    np.testing.assert_array_equal(target_atlas(scene.model, geom, 8).sphere, shipped)
