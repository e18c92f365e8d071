"""`[[ripple.inside]]`: what lies under a layer, as a bone under the skin, and so how thick the layer is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, Mesh, Volume, load_mesh, load_volume, thickness_map
from ripple_sim.solver.mesh.volume import is_volume

from .motion import Vector

Array = NDArray[np.float64]


class InsideEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple.inside]]`: a body under the layer; the way to it from each texel inwards is the layer's thickness.

    The material's preset is then one of a layer. Places are in the frame of the geom's body. Of several bodies the
    nearest counts; where there is none below, the layer is as thick as at its thickest, or as its limits let it be.
    """

    mesh: str | None = None
    """Path of a mesh file, relative to the scene file."""
    volume: str | None = None
    """Instead, path of a volume: NIfTI, NRRD, the folder of a DICOM series, or .npy. All but .npy need the package
    SimpleITK."""
    threshold: float | None = None
    """Value of the volume at the body's surface."""
    spacing: float | None = None
    """Between the nodes of a .npy [m]; a scan has its own."""
    origin: Vector = (0.0, 0.0, 0.0)
    """Where the first node of a .npy is [m]."""
    scale: float = 1.0
    """To metres, where the file is in other units. Scans are read in metres."""

    def located(self, folder: Path) -> InsideEntry:
        """The same with its path made relative to a folder."""
        mesh, volume = (None if path is None else str(folder / path) for path in (self.mesh, self.volume))
        return msgspec.structs.replace(self, mesh=mesh, volume=volume)

    def check(self) -> None:
        """Raise `SceneError` where keys are missing, too many, or out of range."""
        if (self.mesh is None) == (self.volume is None):
            raise SceneError("a [[ripple.inside]] names neither or both of mesh and volume; valid is one of them")
        if self.volume is not None and self.threshold is None:
            raise SceneError(
                f"the volume {self.volume!r} of a [[ripple.inside]] needs a threshold: its value at the surface of "
                "what lies inside, about 300 for bone in Hounsfield units"
            )
        if self.mesh is not None and (self.threshold is not None or self.spacing is not None):
            raise SceneError(f"the mesh {self.mesh!r} of a [[ripple.inside]] takes no threshold and no spacing")
        for key, value in (("scale", self.scale), ("spacing", self.spacing)):
            if value is not None and not value > 0:
                raise SceneError(f"the {key} of a [[ripple.inside]] is {value!r}; valid is a number greater than 0")

    def body(self) -> Mesh | Volume:
        """What is inside, in the frame of the geom's body.

        Raises
        ------
        MeshError
            If the file cannot be read.
        """
        return load_inside(self.mesh or self.volume or "", self.threshold, self.spacing, self.origin, self.scale)


def layer_thickness(
    atlas: Atlas,
    entries: Sequence[InsideEntry],
    limits: tuple[float, float],
    to_atlas: Callable[[ArrayLike], Array],
) -> Array:
    """Thickness of the layer over some bodies, [C, n, n], and its limits [m]; `to_atlas` moves points to the atlas."""
    return thickness_map(atlas, [_moved(entry.body(), to_atlas) for entry in entries], limits)


def _moved(body: Mesh | Volume, to_atlas: Callable[[ArrayLike], Array]) -> Mesh | Volume:
    if isinstance(body, Mesh):
        return dataclasses.replace(body, V=to_atlas(body.V))
    origin = np.asarray(body.origin, dtype=np.float64)
    ends = to_atlas(origin + np.asarray(body.directions, dtype=np.float64).T)
    return dataclasses.replace(body, origin=to_atlas(origin), directions=(ends - to_atlas(origin)).T)


def load_inside(
    path: str | Path,
    threshold: float | None = None,
    spacing: float | None = None,
    origin: Vector = (0.0, 0.0, 0.0),
    scale: float = 1.0,
) -> Mesh | Volume:
    """Read what lies inside: a volume where the path is that of one, else a mesh; scaled.

    Raises
    ------
    MeshError
        If the file cannot be read.
    SceneError
        If a volume comes without a threshold, or a mesh with one.
    """
    if not is_volume(path):
        if threshold is not None or spacing is not None:
            raise SceneError(f"{str(path)!r} is a mesh, which takes no threshold and no spacing; leave them out")
        mesh = load_mesh(path)
        return dataclasses.replace(mesh, V=scale * mesh.V)
    if threshold is None:
        raise SceneError(
            f"{str(path)!r} is a volume, which needs a threshold: its value at the surface of what is inside"
        )
    volume = load_volume(path, threshold, spacing, origin)
    place, between = scale * np.asarray(volume.origin), scale * np.asarray(volume.spacing)
    return volume if scale == 1 else dataclasses.replace(volume, origin=place, spacing=between)
