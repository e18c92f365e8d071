"""A default scene round any mesh: the target on a floor, and bodies that rain on it."""

from __future__ import annotations

import colorsys
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh, load_mesh
from ripple_sim.solver.texels.cube_map.rays import downward_hits

from .camera import CameraEntry
from .events import Events
from .load_scene import Edit
from .mesh_picture import load_picture, mesh_picture
from .motion import DropEntry
from .scene import Scene
from .scene_file import MaterialEntry, RippleEntry
from .up_axis import UP_AXES, usual_up

SIZE = 1.0  # the target's longest edge of its bounding box [m]
DURATION = 5.0

_GEOM = mujoco.mjtGeom
# shape, half-sizes over the body's radius
_SHAPES = (
    (_GEOM.mjGEOM_SPHERE, (1.0, 0.0, 0.0)),
    (_GEOM.mjGEOM_BOX, (0.8, 0.8, 0.8)),
    (_GEOM.mjGEOM_CAPSULE, (0.65, 0.85, 0.0)),
    (_GEOM.mjGEOM_ELLIPSOID, (1.2, 0.9, 0.7)),
    (_GEOM.mjGEOM_CYLINDER, (0.9, 0.5, 0.0)),
)
_HUES = (0.01, 0.48, 0.60, 0.08, 0.82, 0.36)


def drop_scene(
    mesh_path: str | Path,
    *,
    bodies: int = 12,
    seed: int = 0,
    up: str | None = None,
    look: str = "rubber",
    texture: str | Path | None = None,
    repair: bool = False,
    edit: Edit | None = None,
) -> Scene:
    """Scene in which bodies of several shapes fall on a mesh.

    The mesh is scaled to a longest extent of 1 m and stands on a floor; it collides as its true surface.

    Parameters
    ----------
    mesh_path : path
        Any closed genus-0 mesh.
    bodies : int
        How many fall, 0 to 100, spread over the first three seconds and a half.
    seed : int
        Of the shapes, sizes and places.
    up : str, optional
        Axis of the file that points up, "y" or "z". By default "z" for STL, else "y", as is usual for each.
    look : str
        Of the target.
    texture : path, optional
        Picture in the mesh's own texture coordinates, which takes the place of the look's colour. By default the one
        that the file names (an OBJ's material library, a GLB), or NAME_texture.png beside it.
    repair : bool
        Mend a mesh that is open or not manifold (needs the package pymeshfix).
    edit : callable, optional
        Called with the model's specification (`mujoco.MjSpec`) before it is compiled, to change it in place.

    Raises
    ------
    MeshError
        If the mesh cannot be read or is not closed and of genus 0.
    SceneError
        For an invalid number of bodies or axis, if MuJoCo refuses the mesh, or for a texture that cannot be read or
        that a mesh without texture coordinates cannot show.
    """
    if not 0 <= bodies <= 100:
        raise SceneError(f"the number of bodies is {bodies}; valid is 0 to 100")
    up = up or usual_up(mesh_path)
    if up not in UP_AXES:
        raise SceneError(f"the up axis is {up!r}; valid are {' and '.join(map(repr, UP_AXES))}")
    mesh = load_mesh(mesh_path, repair=repair)
    V = _standing(mesh, up)
    rng = np.random.default_rng(seed)
    spec, drops = _build(V, mesh.F, bodies, rng)
    _paint(spec, mesh, mesh_path, texture)
    if edit is not None:
        edit(spec)
    try:
        model = spec.compile()
    except ValueError as error:
        raise SceneError(f"MuJoCo refuses the mesh {str(mesh_path)!r}: {' '.join(str(error).split())}") from error
    middle = float(V[:, 2].max()) / 2
    return Scene(
        name=Path(mesh_path).stem,
        model=model,
        targets=(
            RippleEntry(
                geom="target",
                resolution=128,
                look=look,
                material=MaterialEntry(speed=0.6, damping=1.2, stiffness=1000.0, viscosity=3e-4, density=180.0),
            ),
        ),
        camera=CameraEntry(
            lookat=(0.0, 0.0, 0.95 * middle), distance=3.6, azimuth=125.0, elevation=-17.0, fovy=28.0, orbit=5.0
        ),
        duration=DURATION,
        events=Events(drop=tuple(drops)),
    )


def _standing(mesh: Mesh, up: str) -> NDArray[np.float64]:
    """Vertices scaled, turned upright, standing on z = 0 over the origin [m]."""
    V = mesh.V if up == "z" else mesh.V[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    V = V * (SIZE / np.ptp(V, axis=0).max())
    low, high = V.min(axis=0), V.max(axis=0)
    return V - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]


def _build(
    V: NDArray[np.float64], F: NDArray[np.int64], bodies: int, rng: np.random.Generator
) -> tuple[mujoco.MjSpec, list[DropEntry]]:
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.002
    # enough starting points to find the contacts of a body with a target, a fifth of the default's cost
    spec.option.sdf_initpoints = 8
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # springy contacts (restitution about 0.5): a spring of 0.01 s at a damping ratio of 0.2
    spec.default.geom.solref = [0.01, 0.2]
    spec.default.geom.friction = [0.4, 0.005, 0.0001]
    spec.add_mesh(name="target", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=_GEOM.mjGEOM_SDF, meshname="target")
    spec.worldbody.add_geom(
        name="floor",
        type=_GEOM.mjGEOM_PLANE,
        size=[12, 12, 0.1],
        rgba=[0.86, 0.87, 0.88, 1],
        condim=6,
        friction=[0.8, 0.01, 0.02],
    )
    drops = []
    landing = _landing_points(V, F, bodies, rng)
    times = 0.1 + 3.4 * np.arange(bodies) / max(bodies, 1)
    for i in range(bodies):
        kind, proportions = _SHAPES[i % len(_SHAPES)]
        radius = rng.uniform(0.05, 0.085)
        # parked high above until it drops, out of sight and out of reach of the others
        body = spec.worldbody.add_body(name=f"body_{i}", pos=[0.0, 0.0, 20.0 + i], quat=rng.standard_normal(4))
        body.add_freejoint()
        color = colorsys.hsv_to_rgb(_HUES[i % len(_HUES)], rng.uniform(0.6, 0.8), rng.uniform(0.7, 0.95))
        body.add_geom(
            name=f"body_{i}", type=kind, size=[radius * p for p in proportions], density=400, rgba=[*color, 1.0]
        )
        height = rng.uniform(0.8, 1.2)
        x, y, z = landing[i]
        drops.append(
            DropEntry(body=f"body_{i}", time=float(times[i]), position=(float(x), float(y), float(z + height)))
        )
    return spec, drops


def _paint(spec: mujoco.MjSpec, mesh: Mesh, mesh_path: str | Path, texture: str | Path | None) -> None:
    """Give the target its picture, where it has one and can show it."""
    if mesh.corner_uv is None:
        if texture is not None:
            raise SceneError(
                f"texture {str(texture)!r} finds no place on {str(mesh_path)!r}, which has no texture coordinates: "
                "choose a mesh that has them (and needs no repair, which loses them)"
            )
        return
    pixels = mesh_picture(mesh_path) if texture is None else load_picture(texture)
    if pixels is None:
        return
    asset = spec.mesh("target")
    # MuJoCo counts v from the picture's upper edge
    asset.usertexcoord = (mesh.corner_uv * [1.0, -1.0] + [0.0, 1.0]).ravel()
    asset.userfacetexcoord = np.arange(mesh.F.size)
    height, width, channels = pixels.shape
    image = spec.add_texture(
        name="target", type=mujoco.mjtTexture.mjTEXTURE_2D, height=height, width=width, nchannel=channels
    )
    image.data = pixels.tobytes()
    spec.add_material(name="target").textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "target"
    spec.geom("target").material = "target"


def _landing_points(
    V: NDArray[np.float64], F: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Points of the surface that are open to the sky, as a rain drop would find them, shape [count, 3]."""
    found: list[NDArray] = []
    low, high = V.min(axis=0), V.max(axis=0)
    while len(found) < count:
        xy = rng.uniform(low[:2], high[:2], size=(64, 2))
        z = downward_hits(V, F, xy)
        found.extend(np.column_stack([xy, z])[np.isfinite(z)])
    return np.array(found[:count])
