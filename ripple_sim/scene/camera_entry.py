"""`[camera]` of a scene file: where the video is seen from, and `[[camera.key]]`, its path.

`check_camera` compares `[camera]` with the model.
"""

from __future__ import annotations

import typing

import msgspec
import mujoco
import numpy as np

from ripple_sim.errors import SceneError

from .events import Vector

# Largest number of images whose mean is a frame.
MAX_EXPOSURES = 1024

# Fields of a key that move the camera.
PATH_FIELDS = ("lookat", "distance", "azimuth", "elevation", "fovy")

# MuJoCo's modes of cameras that turn to a body.
_TURNS_TO_BODY = (
    int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY),
    int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM),
)


class CameraKey(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[[camera.key]]`: where the free camera is at a time. It moves smoothly from key to key.

    Before the first key and after the last one the camera rests. A key may leave values out: each
    value moves between the keys that give it, and a value that no key gives is that of `[camera]`.
    """

    time: float
    """[s]; keys stand in the order of their times."""
    lookat: Vector | None = None
    """Point that the camera looks at [m]; with `track` from the body's centre of mass."""
    distance: float | None = None
    """From there [m]."""
    azimuth: float | None = None
    """As in `[camera]` [degrees]; a turn continues beyond 360: from 350 to 370, not to 10."""
    elevation: float | None = None
    """Likewise."""
    fovy: float | None = None
    """Vertical field of view [degrees]."""


class CameraEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[camera]`: where the video is seen from."""

    name: str | None = None
    """A camera of the MJCF; by default MuJoCo's free camera."""
    track: str | None = None
    """A body to follow: the free camera moves along with its centre of mass, from which `lookat`
    then counts; a named camera turns towards it."""
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
    """Degrees per second by which the camera circles round the point that it looks at. A camera
    with a name needs a body to circle: `track`, or a `target` in the MJCF."""
    shutter: float = 0.0
    """Shutter angle [degrees]: 360 leaves the shutter open from one frame to the next, 180, usual
    in film, half of that time."""
    aperture: float = 0.0
    """Diameter of the lens [m]; 0: all is sharp. An f-number would need a focal length, which
    MuJoCo's cameras do not have."""
    focus: float | str | Vector | None = None
    """What stays sharp: a distance along the camera's axis [m], the name of a body or a geom, or a
    point in the world [m]; by default the point that the camera looks at."""
    exposures: int = 32
    """Images whose mean is a frame, where `shutter` or `aperture` is not 0; at most 1024."""
    key: list[CameraKey] = []
    """Path of the free camera, see below."""


def check_camera(model: mujoco.MjModel, entry: CameraEntry) -> None:
    """Raise `SceneError` for a camera that does not fit the model, and for impossible numbers."""
    body = mujoco.mjtObj.mjOBJ_BODY
    geom = mujoco.mjtObj.mjOBJ_GEOM
    if entry.name is not None and not _exists(model, mujoco.mjtObj.mjOBJ_CAMERA, entry.name):
        cameras = _names(model, mujoco.mjtObj.mjOBJ_CAMERA, model.ncam)
        raise SceneError(f"the model has no camera {entry.name!r}; its cameras are {cameras}")
    if entry.track is not None and not _exists(model, body, entry.track):
        raise SceneError(
            f"the model has no body {entry.track!r} for the camera to track; its bodies are "
            f"{_names(model, body, model.nbody)}"
        )
    if isinstance(entry.focus, str) and not (
        _exists(model, body, entry.focus) or _exists(model, geom, entry.focus)
    ):
        raise SceneError(
            f"the model has nothing {entry.focus!r} for the camera to focus on; its bodies are "
            f"{_names(model, body, model.nbody)}; its geoms are {_names(model, geom, model.ngeom)}"
        )
    _check_optics(entry)
    _check_path(entry)
    if entry.name is not None and entry.orbit and entry.track is None:
        mode = int(model.cam_mode[model.camera(entry.name).id])
        if mode not in _TURNS_TO_BODY:
            raise SceneError(
                f"the camera {entry.name!r} of the model turns to no body, so orbit = "
                f"{entry.orbit:g} has no point to circle; add track = 'a body', or write lookat, "
                "distance, azimuth and elevation in place of name"
            )


def _check_path(entry: CameraEntry) -> None:
    """Refuse keys that do not make a path."""
    if entry.key and entry.name is not None:
        raise SceneError(
            f"[[camera.key]] moves the free camera, and the camera {entry.name!r} of the model has "
            "a pose of its own; leave out name, or the keys"
        )
    if entry.orbit and any(key.azimuth is not None for key in entry.key):
        raise SceneError(
            f"orbit = {entry.orbit:g} and the azimuths of [[camera.key]] both turn the camera; "
            "leave one of the two out"
        )
    previous_time = -np.inf
    for key in entry.key:
        if not previous_time < key.time < np.inf:
            raise SceneError(
                f"a [[camera.key]] at {key.time:g} s follows one at {previous_time:g} s; the times "
                "of keys must increase"
            )
        previous_time = key.time
        if all(getattr(key, name) is None for name in PATH_FIELDS):
            raise SceneError(
                f"the [[camera.key]] at {key.time:g} s gives nothing but its time; give one or "
                f"more of {', '.join(PATH_FIELDS)}"
            )
        if key.distance is not None and not 0 < key.distance < np.inf:
            _refuse("distance", key.distance, "more than 0 m")
        if key.fovy is not None and not 0 < key.fovy < 180:
            _refuse("fovy", key.fovy, "between 0 and 180 degrees")


def _check_optics(entry: CameraEntry) -> None:
    """Refuse numbers of shutter, lens and exposures that are out of range."""
    if not 0 <= entry.shutter <= 360:
        _refuse("shutter angle", entry.shutter, "0 to 360 degrees")
    if not 0 <= entry.aperture < np.inf:
        _refuse("aperture", entry.aperture, "0 m or more")
    if isinstance(entry.focus, float) and not 0 < entry.focus < np.inf:
        _refuse("focus", entry.focus, "more than 0 m")
    if not 1 <= entry.exposures <= MAX_EXPOSURES:
        _refuse("number of exposures", entry.exposures, f"1 to {MAX_EXPOSURES}")


def _refuse(name: str, value: object, valid: str) -> typing.NoReturn:
    raise SceneError(f"the camera's {name} must be {valid}, got {value!r}")


def _exists(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, kind, name) >= 0)


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> str:
    """Names of all bodies, geoms or cameras of a model, for a message."""
    names = [mujoco.mj_id2name(model, kind, i) for i in range(count)]
    return ", ".join(filter(None, names)) or "none"
