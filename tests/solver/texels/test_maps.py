"""Maps: images and vertex attributes on the texels."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ripple_sim.solver import Atlas, Mesh, SolverError, build_atlas, texture_map, vertex_map


@pytest.fixture(scope="module")
def globe(ball_mesh: Mesh) -> Atlas:
    """A sphere with longitude and latitude as texture coordinates, seam and poles included."""
    V = ball_mesh.V
    F = ball_mesh.F
    corners = V[F]
    u = np.arctan2(corners[..., 1], corners[..., 0]) / (2 * np.pi)
    # triangles across the seam: keep their corners together
    u -= np.round(u - u[:, :1])
    v = np.arcsin(np.clip(corners[..., 2], -1, 1)) / np.pi + 0.5
    return build_atlas(Mesh(V, F, corner_uv=np.stack([u, v], axis=-1)), 48, cache=False)


def test_vertex_map_of_positions_gives_the_texel_positions(animal: Atlas) -> None:
    np.testing.assert_allclose(vertex_map(animal, animal.mesh.V), animal.positions, atol=1e-12)
    np.testing.assert_allclose(
        vertex_map(animal, animal.mesh.V[:, 1]), animal.positions[..., 1], atol=1e-12
    )


def test_an_image_lands_where_its_coordinates_say(globe: Atlas, tmp_path: Path) -> None:
    # a smooth function of latitude and longitude, 16 bits deep, upper row first
    width = 256
    height = 128
    longitude = (np.arange(width) + 0.5) / width * 2 * np.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    bands = 0.3 * np.sin(latitude)[:, None]
    sectors = 0.2 * np.cos(latitude)[:, None] ** 2 * np.cos(2 * longitude)
    values = 0.5 + bands + sectors
    path = tmp_path / "map.png"
    Image.fromarray(np.round(values * 65535).astype(np.uint16)).save(path)
    directions = globe.positions / np.linalg.norm(globe.positions, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(directions, -1, 0)
    expected = 0.5 + 0.3 * z + 0.2 * (x**2 - y**2)
    # coordinates are linear in each triangle, which is wrong next to the poles
    inside = np.abs(z) < 0.95
    np.testing.assert_allclose(texture_map(globe, path)[inside], expected[inside], atol=0.005)
    falling = texture_map(globe, values, low=2.0, high=-1.0)
    np.testing.assert_allclose(falling[inside], (2 - 3 * expected)[inside], atol=0.015)


def test_channels_of_an_image_are_selected_by_name(globe: Atlas, tmp_path: Path) -> None:
    path = tmp_path / "color.png"
    Image.new("RGBA", (4, 4), (51, 102, 204, 255)).save(path)
    for channel, value in {
        "red": 0.2,
        "green": 0.4,
        "blue": 0.8,
        "alpha": 1.0,
        "luminance": 1.4 / 3,
    }.items():
        np.testing.assert_allclose(texture_map(globe, path, channel=channel), value, atol=1e-12)


def test_bad_maps_are_named(animal: Atlas, globe: Atlas, tmp_path: Path) -> None:
    with pytest.raises(SolverError, match="no texture coordinates"):
        texture_map(animal, np.ones((4, 4)))
    with pytest.raises(SolverError, match=r"missing\.png.* cannot be read"):
        texture_map(globe, tmp_path / "missing.png")
    with pytest.raises(SolverError, match="no channel 'green'"):
        texture_map(globe, np.ones((4, 4)), channel="green")
    with pytest.raises(SolverError, match="'luminance', 'red'"):
        texture_map(globe, np.ones((4, 4)), channel="hue")
    with pytest.raises(SolverError, match="one a vertex"):
        vertex_map(animal, np.ones(3))
