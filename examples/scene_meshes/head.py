"""A cartoon head and its skull: meshes and images of the scenes `face` and `skull`.

    python examples/scene_meshes/head.py

writes `face.obj` with texture coordinates, its colours `face.png`, the image `face_waves.png` that
tells where waves run, and `skull.obj` to scenes/meshes again; `--volume FILE` writes the whole head
as voxels instead, a .npy, as a scanner would see it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.scenes.shapes import (
    Array,
    Sdf,
    capsule,
    ellipsoid,
    half_space,
    mirrored,
    polygonise,
    rounded_cone,
    smooth_intersection,
    smooth_union,
    sphere,
    write_obj,
)
from ripple_sim.solver.files import atomic_write

FOLDER = Path(__file__).parents[2] / "scenes" / "meshes"

# texture coordinates are longitude and latitude about this point [m]
_MIDDLE = np.array([0.0, 0.0, 0.52])
_HEIGHT = 512  # of the images [pixels]; they are twice as wide
_FINER = 2  # they are painted so many times as fine, for smooth edges

_EYE = np.array([0.205, 0.108, 0.575])
_EYE_RADIUS = 0.088
_GAZE = np.array([0.955, -0.10, 0.12])  # of the eye at y > 0
# radii [m]
_IRIS = 0.048
_PUPIL = 0.026
_GLINT = 0.011

_SKIN = (236, 190, 150)
_CHEEK = (232, 150, 124)
_LIP = (196, 92, 84)
_WHITE = (250, 250, 246)
_BLUE = (58, 128, 150)
_BLACK = (24, 24, 30)

FOOT = 0.13  # height at which the neck is cut off [m]
# ears stand off the head towards the back
_FLARED = np.array(
    [[np.cos(0.45), np.sin(0.45), 0.0], [-np.sin(0.45), np.cos(0.45), 0.0], [0.0, 0.0, 1.0]]
)

# a box round the head [m]
LOW = np.array([-0.42, -0.42, 0.10])
HIGH = np.array([0.45, 0.42, 0.95])

# What a scanner makes of air, soft tissue and bone [Hounsfield units], the thresholds between them,
# and its noise.
AIR = -1000.0
TISSUE = 40.0
BONE = 1000.0
SKIN_THRESHOLD = (AIR + TISSUE) / 2
BONE_THRESHOLD = (TISSUE + BONE) / 2
_NOISE = 25.0

_LIPS = smooth_union(
    0.02,
    mirrored(capsule((0.268, 0.0, 0.352), (0.222, 0.095, 0.378), 0.019)),
    mirrored(capsule((0.262, 0.0, 0.322), (0.222, 0.092, 0.368), 0.021)),
)


def head(cell: float = 0.017) -> tuple[Array, NDArray[np.int64]]:
    """Model a head 0.75 m high that faces +x and stands on z = 0; see `polygonise`."""
    V, F = polygonise(head_solid(), ((-0.4, -0.4, 0.1), (0.45, 0.4, 0.95)), cell)
    return V - [0.0, 0.0, FOOT], F


def head_solid() -> Sdf:
    """Solid of the head, before its foot is put on the ground: negative distances inside [m]."""
    skull = ellipsoid((-0.03, 0.0, 0.60), (0.29, 0.26, 0.28))
    jaw = ellipsoid((0.05, 0.0, 0.40), (0.215, 0.205, 0.20))
    cheek = sphere((0.13, 0.115, 0.425), 0.10)
    neck = rounded_cone((-0.03, 0.0, 0.34), (-0.04, 0.0, 0.10), 0.13, 0.17)
    nose = rounded_cone((0.255, 0.0, 0.56), (0.315, 0.0, 0.475), 0.03, 0.056)
    brow = capsule((0.243, 0.06, 0.672), (0.188, 0.165, 0.676), 0.024)
    ear = ellipsoid((-0.03, 0.285, 0.55), (0.062, 0.026, 0.092), _FLARED)
    hollow = ellipsoid((-0.005, 0.322, 0.56), (0.036, 0.03, 0.056), _FLARED)
    ear = smooth_intersection(0.02, ear, lambda points: -hollow(points))
    solid = smooth_union(0.10, skull, jaw, mirrored(cheek))
    solid = smooth_union(0.05, solid, neck, nose, mirrored(brow))
    solid = smooth_union(0.04, solid, mirrored(ear))
    solid = smooth_union(0.03, solid, mirrored(sphere(_EYE, _EYE_RADIUS)))
    solid = smooth_union(0.02, solid, _LIPS)
    return smooth_intersection(0.03, solid, half_space((0.0, 0.0, -1.0), -FOOT))


def write_mesh(path: Path) -> None:
    """Write the head as OBJ, with texture coordinates that end at the back."""
    V, F = head()
    uv = _coordinates(V + np.array([0.0, 0.0, FOOT]))[F]
    # triangles across the end of the image go on into its next repetition
    uv[..., 0] += uv[..., 0] < uv[..., 0].max(axis=1, keepdims=True) - 0.5
    unique, index = np.unique(np.round(uv.reshape(-1, 2), 5), axis=0, return_inverse=True)
    lines = ["# made by python examples/scene_meshes/head.py"]
    lines += [f"v {x:.5g} {y:.5g} {z:.5g}" for x, y, z in V]
    lines += [f"vt {u:.5g} {v:.5g}" for u, v in unique]
    corners = np.stack([F, index.reshape(F.shape)], axis=2) + 1
    lines += [
        "f " + " ".join(f"{vertex}/{texture}" for vertex, texture in face) for face in corners
    ]
    with atomic_write(path) as unfinished:
        unfinished.write_text("\n".join(lines) + "\n")


def write_images(colors: Path, waves: Path) -> None:
    """Write the colours, and where waves run: white; the eyes, black, stay still."""
    points = _painted_points()
    size = (2 * _HEIGHT, _HEIGHT)
    Image.fromarray(_colors(points)).resize(size, Image.Resampling.BOX).save(colors, optimize=True)
    still = np.where(_is_eye(points), 0, 255).astype(np.uint8)
    Image.fromarray(still).resize(size, Image.Resampling.BOX).save(waves, optimize=True)


def _coordinates(points: Array) -> Array:
    """Texture coordinates [..., 2] of points [..., 3]: longitude from the face, and latitude."""
    x, y, z = np.moveaxis(points - _MIDDLE, -1, 0)
    return np.stack(
        [0.5 + np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arctan2(z, np.hypot(x, y)) / np.pi], axis=-1
    )


def _painted_points() -> Array:
    """Outermost points of the head at the pixels of an image, [height, width, 3], top row first."""
    height = _FINER * _HEIGHT
    width = 2 * _FINER * _HEIGHT
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    longitude = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    x = np.cos(latitude) * np.cos(longitude)
    y = np.cos(latitude) * np.sin(longitude)
    z = np.sin(latitude)
    ways = np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1)
    solid = head_solid()
    away = np.full((height, width), 0.5)
    front = x > 0.5  # what is painted lies here
    for _ in range(30):  # from outside inwards; the distances are approximate, so in shorter steps
        away[front] -= 0.8 * solid(_MIDDLE + away[front][:, None] * ways[front])
    return _MIDDLE + away[..., None] * ways


def _colors(points: Array) -> NDArray[np.uint8]:
    image = np.empty(points.shape)
    image[:] = _SKIN
    both = points * [1.0, 0.0, 1.0] + np.abs(points) * [0.0, 1.0, 0.0]
    flush = np.exp(-((np.linalg.norm(both - [0.225, 0.15, 0.44], axis=-1) / 0.06) ** 2))
    image += 0.7 * flush[..., None] * np.subtract(_CHEEK, _SKIN)
    image[_LIPS(points.reshape(-1, 3)).reshape(points.shape[:2]) < 0.002] = _LIP
    eye = _is_eye(points)
    image[eye] = _WHITE
    gaze = _GAZE / np.linalg.norm(_GAZE)
    middle = _EYE + _EYE_RADIUS * gaze
    off = np.linalg.norm(both - middle, axis=-1)
    image[eye & (off < _IRIS)] = _BLUE
    image[eye & (off < _PUPIL)] = _BLACK
    glint = np.linalg.norm(both - middle - [0.0, -0.013, 0.020], axis=-1)
    image[eye & (glint < _GLINT)] = _WHITE
    return image.round().astype(np.uint8)


def _is_eye(points: Array) -> NDArray[np.bool_]:
    """Whether points [..., 3] of the surface lie on an eyeball."""
    eye = mirrored(sphere(_EYE, _EYE_RADIUS))
    return eye(points.reshape(-1, 3)).reshape(points.shape[:-1]) < 0.0015


def skull(cell: float = 0.02) -> tuple[Array, NDArray[np.int64]]:
    """Model the skull in the head's frame: close under the forehead, deep under the cheeks."""
    V, F = polygonise(_skull_solid(), (LOW, HIGH), cell)
    return V - [0.0, 0.0, FOOT], F


def _skull_solid() -> Sdf:
    cranium = ellipsoid((-0.032, 0.0, 0.60), (0.268, 0.236, 0.258))
    upper_jaw = ellipsoid((0.125, 0.0, 0.455), (0.125, 0.125, 0.075))
    chin = ellipsoid((0.075, 0.0, 0.315), (0.105, 0.10, 0.07))
    branch = capsule((0.05, 0.115, 0.31), (-0.02, 0.125, 0.47), 0.035)
    cheekbone = capsule((0.135, 0.115, 0.50), (0.02, 0.17, 0.51), 0.025)
    spine = rounded_cone((-0.05, 0.0, 0.36), (-0.05, 0.0, 0.23), 0.06, 0.07)
    nose = capsule((0.222, 0.0, 0.575), (0.245, 0.0, 0.545), 0.018)
    socket = sphere((0.205, 0.108, 0.575), 0.075)
    solid = smooth_union(
        0.05, cranium, upper_jaw, chin, mirrored(branch), mirrored(cheekbone), spine
    )
    solid = smooth_intersection(0.02, solid, lambda points: -mirrored(socket)(points))
    return smooth_union(0.015, solid, nose)


def head_volume(spacing: float = 0.01, seed: int = 0) -> tuple[NDArray[np.int16], Array]:
    """Scan the head: voxels [i, j, k] along x, y and z [Hounsfield units], and their origin.

    The origin is the place of the first voxel [m]. The scanner blurs over a voxel and is noisy.
    """
    counts = np.ceil((HIGH - LOW) / spacing).astype(int) + 1
    nodes = np.moveaxis(np.indices(tuple(counts)), 0, -1).reshape(-1, 3) * spacing + LOW
    values = np.full(len(nodes), AIR)
    for solid, step in ((head_solid(), TISSUE - AIR), (_skull_solid(), BONE - TISSUE)):
        values += step / (1 + np.exp(np.clip(4 / spacing * solid(nodes), -50, 50)))
    values += np.random.default_rng(seed).normal(0.0, _NOISE, len(values))
    return values.round().astype(np.int16).reshape(tuple(counts)), LOW - [0.0, 0.0, FOOT]


def main() -> None:
    parser = argparse.ArgumentParser(description="The head of the scenes face and skull.")
    parser.add_argument("--volume", type=Path, help="write the head's voxels to this .npy instead")
    parser.add_argument("--spacing", type=float, default=0.01, help="of the voxels [m]")
    chosen = parser.parse_args()
    if chosen.volume is None:
        write_mesh(FOLDER / "face.obj")
        write_images(FOLDER / "face.png", FOLDER / "face_waves.png")
        write_obj(FOLDER / "skull.obj", *skull())
        return
    values, origin = head_volume(chosen.spacing)
    with atomic_write(chosen.volume) as unfinished, unfinished.open("wb") as file:
        np.save(file, values)
    print(
        f"{chosen.volume}: spacing {chosen.spacing:g} m, origin {origin.tolist()} m, bone from "
        f"{BONE_THRESHOLD:g} on"
    )


if __name__ == "__main__":
    main()
