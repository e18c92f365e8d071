"""`[camera]` of a scene file, and whether the model and the optics can do what it says."""

from __future__ import annotations

import msgspec
import mujoco
import numpy as np

from ripple_sim.errors import SceneError

from .motion import Vector

MAX_EXPOSURES = 1024


class CameraEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[camera]`: where the video is seen from."""

    name: str | None = None
    """A camera of the MJCF; by default MuJoCo's free camera."""
    track: str | None = None
    """A body to follow: the free camera moves along with its centre of mass, from which `lookat` then counts; a named
    camera turns towards it."""
    lookat: Vector | None = None
    """Point that the free camera looks at [m]; by default the model's middle."""
    distance: float | None = None
    """From there [m]; by default by the model's extent."""
    azimuth: float = 90.0
    """As in MuJoCo's viewer [degrees]."""
    elevation: float = -20.0
    """Likewise; negative looks down."""
    fovy: float = 45.0
    """Vertical field of view [degrees]."""
    orbit: float = 0.0
    """Degrees per second by which the camera circles."""
    shutter: float = 0.0
    """Shutter angle [degrees]: 360 leaves the shutter open from one frame to the next, 180, usual in film, half of that
    time."""
    aperture: float = 0.0
    """Diameter of the lens [m]; 0: all is sharp. An f-number would need a focal length, which MuJoCo's cameras do not
    have."""
    focus: float | str | Vector | None = None
    """What stays sharp: a distance along the camera's axis [m], the name of a body or a geom, or a point in the world
    [m]; by default the point that the camera looks at."""
    exposures: int = 32
    """Images of which a frame is the mean where `shutter` or `aperture` is not 0; at most 1024."""


def check_camera(model: mujoco.MjModel, entry: CameraEntry) -> None:
    """Make sure that the model has what the camera names, and that the exposure is possible.

    Raises
    ------
    SceneError
    """
    for name, kind, count, missing in (
        (entry.name, mujoco.mjtObj.mjOBJ_CAMERA, model.ncam, "camera {!r}; its cameras are"),
        (entry.track, mujoco.mjtObj.mjOBJ_BODY, model.nbody, "body {!r} for the camera to track; its bodies are"),
    ):
        if name is not None and mujoco.mj_name2id(model, kind, name) < 0:
            raise SceneError(f"the model has no {missing.format(name)} {_names(model, kind, count)}")
    body, geom = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_GEOM
    if isinstance(entry.focus, str) and all(mujoco.mj_name2id(model, kind, entry.focus) < 0 for kind in (body, geom)):
        raise SceneError(
            f"the model has nothing {entry.focus!r} for the camera to focus on; its bodies are "
            f"{_names(model, body, model.nbody)}; its geoms are {_names(model, geom, model.ngeom)}"
        )
    for name, value, valid, right in (
        ("shutter angle", entry.shutter, "0 to 360 degrees", 0 <= entry.shutter <= 360),
        ("aperture", entry.aperture, "0 m or more", 0 <= entry.aperture < np.inf),
        ("focus", entry.focus, "more than 0 m", not isinstance(entry.focus, float) or 0 < entry.focus < np.inf),
        ("number of exposures", entry.exposures, f"1 to {MAX_EXPOSURES}", 1 <= entry.exposures <= MAX_EXPOSURES),
    ):
        if not right:
            raise SceneError(f"the camera's {name} is {value!r}; valid is {valid}")


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> str:
    return ", ".join(name for i in range(count) if (name := mujoco.mj_id2name(model, kind, i))) or "none"
