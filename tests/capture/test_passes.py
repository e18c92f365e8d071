"""Passes of scenes that are known: a ball, a floor, and tracked points on a rippling egg."""

from collections.abc import Iterator

import numpy as np
import pytest
from scene_files import write_scene

from ripple_sim import Simulation, load_scene
from ripple_sim.capture import FrameSource, Sighting, passes_of, snapshots
from ripple_sim.export import MovingMesh

WIDTH = 160
HEIGHT = 120
MJCF = """<mujoco><option timestep="0.002" gravity="0 0 -3"/><worldbody>
<geom name="floor" type="plane" size="9 9 .1" pos="0 0 -0.5"/>
<body name="egg" pos="-0.4 0 0"><joint type="hinge" axis="0 0 1"/>
  <geom name="egg" type="ellipsoid" size="0.35 0.3 0.25" mass="1"/></body>
<body name="ball" pos="0.6 0.1 0.4"><freejoint/><geom name="ball" size="0.25"/></body>
</worldbody></mujoco>"""
TOML = """model = "scene.xml"
duration = 1.0
[camera]
lookat = [0, 0, 0]
distance = 3.0
azimuth = 90
elevation = -15
fovy = 35
orbit = 30
[[ripple]]
geom = "egg"
look = "water"
resolution = 16
limit = false
material = {speed = 0.5, density = 20.0}
"""
# in the segmentation
FLOOR = 1
EGG = 2
BALL = 3


@pytest.fixture(scope="module", params=["rigid", "moving"])
def seen(request, tmp_path_factory, opengl) -> list[tuple[Sighting, np.ndarray]]:
    """Two frames: what is seen, and where points on the egg are in the world.

    Its surface may move by itself, too.
    """
    path = write_scene(tmp_path_factory.mktemp("scene"), MJCF, TOML)
    simulation = Simulation(load_scene(path), fps=20, backend="cpu")
    simulation.data.qvel[:] = [1.5, 0.8, 0, 0, 0, 0, 0]
    waves = simulation.ripples["egg"]
    x, y, z = np.moveaxis(waves.atlas.normals, -1, 0)
    waves.height = 0.03 * np.sin(6 * x) * np.cos(5 * z)
    waves.velocity = 0.4 * np.cos(7 * x + y)
    source = FrameSource(simulation, width=WIDTH, height=HEIGHT)
    mesh = MovingMesh(waves.atlas, "refined", limit=False)

    def look() -> Iterator[tuple[Sighting, np.ndarray]]:
        for snapshot in snapshots(simulation, 2):
            rotation = snapshot.data.geom("egg").xmat.reshape(3, 3)
            V = waves.vertices
            points = mesh.shape(snapshot.heights["egg"], snapshot.heights["egg"], V).points.astype(
                float
            )
            yield source.sighting(snapshot), points @ rotation.T + snapshot.data.geom("egg").xpos
            if request.param == "moving":
                rest = waves.rest.mesh.V
                waves.move(rest * [1.0, 1.1, 0.9] + 0.03 * np.sin(8 * rest[:, [1, 2, 0]]))

    return list(look())


def test_segmentation_names_every_pixel(seen: list[tuple[Sighting, np.ndarray]]) -> None:
    passes = passes_of(seen[0][0], None, ("segmentation",))
    counts = np.bincount(passes["segmentation"].ravel(), minlength=4)
    assert (counts[[0, FLOOR, EGG, BALL]] > 500).all()
    assert counts.sum() == counts[:4].sum()


def test_positions_and_normals_on_a_ball_are_its_own(
    seen: list[tuple[Sighting, np.ndarray]],
) -> None:
    sighting = seen[0][0]
    passes = passes_of(sighting, None, ("position", "normal", "segmentation", "depth"))
    ball = passes["segmentation"] == BALL
    out = passes["position"][ball] - sighting.positions[BALL - 1]
    radius = np.linalg.norm(out, axis=1)
    assert 0.24 < radius.min() <= radius.max() < 0.2501  # its triangles lie within it
    direction = out / np.linalg.norm(out, axis=1, keepdims=True)
    assert np.linalg.norm(passes["normal"][ball] - direction, axis=1).max() < 0.02
    floor = passes["segmentation"] == FLOOR
    assert passes["position"][floor][:, 2] == pytest.approx(-0.5, abs=1e-5)
    assert passes["normal"][floor] == pytest.approx(np.tile([0, 0, 1], (floor.sum(), 1)))
    # depth is the distance along the camera's axis
    away = (sighting.pose.position - passes["position"][ball]) @ sighting.pose.rotation[:, 2]
    assert passes["depth"][ball] == pytest.approx(away, rel=1e-5)
    assert np.isinf(passes["depth"][passes["segmentation"] == 0]).all()


def nearest_points(
    sighting: Sighting, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of points of the egg, those that are seen, and the rows and columns of their pixels."""
    place = sighting.pixels(points)
    column, row = np.floor(place).astype(int).T
    inside = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
    found = np.flatnonzero(inside)
    at = sighting.positions_seen[row[found], column[found]]
    near = np.linalg.norm(at - points[found], axis=1) < 0.02
    near &= sighting.image.geom[row[found], column[found]] == EGG - 1
    return found[near], row[found[near]], column[found[near]]


def test_heights_and_places_are_those_of_the_waves(seen: list[tuple[Sighting, np.ndarray]]) -> None:
    sighting, points = seen[0]
    found, row, column = nearest_points(sighting, points)
    assert len(found) > 300
    assert (
        np.median(np.linalg.norm(sighting.positions_seen[row, column] - points[found], axis=1))
        < 0.01
    )
    height = passes_of(sighting, None, ("height",))["height"]
    assert np.ptp(height) > 0.04
    assert (height[sighting.image.geom != EGG - 1] == 0).all()


def test_flow_is_the_displacement_of_tracked_points(
    seen: list[tuple[Sighting, np.ndarray]],
) -> None:
    (sighting, before), (later, after) = seen
    flow = passes_of(sighting, later, ("flow",))["flow"]
    found, row, column = nearest_points(sighting, before)
    moved = later.pixels(after[found]) - sighting.pixels(before[found])
    assert np.median(np.linalg.norm(moved, axis=1)) > 1.0
    error = np.linalg.norm(flow[row, column] - moved, axis=1)
    assert np.median(error) < 0.1
    # without the motion of the waves the flow would be wrong
    with_still_waves = Sighting(
        later.image,
        later.pose,
        later.positions,
        later.rotations,
        sighting.height_maps,
        later.meshes,
    )
    flow_without_waves = sighting.flow_to(with_still_waves)[row, column]
    error_without_waves = np.linalg.norm(flow_without_waves - moved, axis=1)
    assert np.median(error_without_waves) > 3 * np.median(error)
    ball = sighting.image.geom == BALL - 1
    centre = later.pixels(later.positions[BALL - 1]) - sighting.pixels(sighting.positions[BALL - 1])
    assert np.linalg.norm(flow[ball].mean(axis=0) - centre) < 0.3
    assert (flow[sighting.image.geom < 0] == 0).all()


def test_a_point_of_the_world_is_where_the_camera_projects_it(
    seen: list[tuple[Sighting, np.ndarray]],
) -> None:
    sighting = seen[0][0]
    column, row = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    there = sighting.image.depth > 0
    found = sighting.pixels(sighting.positions_seen[there])
    assert np.abs(found - np.stack([column, row], axis=-1)[there]).max() < 1e-6
