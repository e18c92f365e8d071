"""Volumes of voxels, as a scan gives them, and the surfaces in them.

Read from NIfTI, DICOM series, NRRD, and whatever else SimpleITK reads, and from arrays of NumPy.
"""

from __future__ import annotations

import dataclasses
import importlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import PATH, MeshError, checked, is_finite, shown
from .wrap import zero_surface

# Endings of files that are read as volumes.
VOLUME_ENDINGS = (".npy", ".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm")

# The unit of scans [m].
_MILLIMETRE = 1e-3


@dataclasses.dataclass(frozen=True, eq=False)
class Volume:
    """Values at the nodes of a regular grid, and the value at which a body begins.

    Attributes
    ----------
    values : [i, j, k]
        Along x, y and z; higher inside of the body.
    threshold : float
        Value at the body's surface.
    spacing : float or [3]
        Between nodes [m].
    origin : [3]
        Where node (0, 0, 0) is [m].
    directions : [3, 3]
        Its columns are the ways along which i, j and k grow: unit vectors at right angles.
    """

    values: ArrayLike
    threshold: float
    spacing: float | ArrayLike = 1.0
    origin: ArrayLike = (0.0, 0.0, 0.0)
    directions: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices [n, 3] [m] and triangles [m, 3] of the surface at the threshold.

        Marching cubes find the surface, which is often noisy.

        Raises
        ------
        MeshError
            If the grid is no volume of finite numbers, or no value reaches the threshold.
        """
        values = np.asarray(self.values, dtype=np.float64)
        spacing = np.broadcast_to(np.asarray(self.spacing, dtype=np.float64), 3)
        if values.ndim != 3 or min(values.shape) < 2 or not np.isfinite(values).all():
            raise MeshError(
                "a volume must hold finite numbers [i, j, k], two or more along each side, got "
                f"shape {values.shape}"
            )
        if not (spacing > 0).all() or not is_finite(self.threshold):
            raise MeshError(
                "a volume's spacing and threshold must be finite numbers, the spacing greater "
                f"than 0, got {shown(self.spacing)} m and {shown(self.threshold)}"
            )
        if not values.min() < self.threshold < values.max():
            raise MeshError(
                f"the threshold must lie between the volume's values, {values.min():g} to "
                f"{values.max():g}, got {self.threshold:g}"
            )
        V, F = zero_surface(self.threshold - values, np.zeros(3), spacing)
        directions = np.asarray(self.directions, dtype=np.float64)
        turned = V @ directions.T + np.asarray(self.origin, dtype=np.float64)
        return turned, F if np.linalg.det(directions) > 0 else F[:, ::-1]


def is_volume(path: str | Path) -> bool:
    """Whether a path names a volume, by its ending, or a folder, such as a DICOM series."""
    return str(path).lower().endswith(VOLUME_ENDINGS) or Path(path).is_dir()


@checked(MeshError, path=PATH)
def load_volume(
    path: str | Path,
    threshold: float,
    spacing: float | ArrayLike | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> Volume:
    """Read a volume: a NIfTI or NRRD file, the folder of a DICOM series, or a .npy file.

    A scan's own millimetres, places and directions are kept, in metres: x, y and z go to the
    patient's left, back and head, in DICOM, NRRD and NIfTI alike. All but .npy need the package
    SimpleITK (extra `medical`).

    Parameters
    ----------
    path : path
    threshold : float
        Value at the body's surface, in the file's units: about 300 Hounsfield units for bone, -300
        for skin.
    spacing : float or [3], optional
        Between the nodes of a .npy, whose array is [i, j, k] along x, y and z [m]; a scan has its
        own.
    origin : [3]
        Where the first node of a .npy is [m].

    Raises
    ------
    MeshError
        If the file cannot be read, SimpleITK is missing, or the spacing of a .npy is.
    """
    path = Path(path)
    if not path.exists():
        raise MeshError(
            f"volume {str(path)!r} does not exist: it must be a folder or a file that ends in "
            f"{', '.join(VOLUME_ENDINGS)}"
        )
    if not is_volume(path):
        raise MeshError(
            f"volume {str(path)!r} has an unknown ending: it must end in "
            f"{', '.join(VOLUME_ENDINGS)}"
        )
    if path.suffix.lower() != ".npy":
        if spacing is not None:
            raise MeshError(
                f"volume {str(path)!r} has a spacing of its own; leave it out, it is for .npy files"
            )
        return _scan(path, threshold)
    if spacing is None:
        raise MeshError(
            f"volume {str(path)!r} needs a spacing: the way between voxels in metres, such as 0.001"
        )
    try:
        values = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise MeshError(f"volume {str(path)!r} cannot be read: {error}") from error
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "iuf":
        raise MeshError(f"volume {str(path)!r} must hold an array of numbers [i, j, k]")
    return Volume(values, threshold, spacing, origin)


def _scan(path: Path, threshold: float) -> Volume:
    try:
        itk: Any = importlib.import_module("SimpleITK")
    except ImportError as error:
        raise MeshError(
            f"volume {str(path)!r} needs the package SimpleITK: pip install 'ripple-sim[medical]', "
            f"or save the voxels "
            "as .npy"
        ) from error
    # its readers write to stderr beside what they raise
    itk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        names: Any = str(path)
        if path.is_dir():
            names = itk.ImageSeriesReader.GetGDCMSeriesFileNames(str(path))
            if not names:
                raise MeshError(
                    f"folder {str(path)!r} holds no DICOM series; give one that does, or a "
                    f"volume's file"
                )
        image = itk.ReadImage(names)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].removeprefix("sitk::ERROR: ")
        raise MeshError(f"volume {str(path)!r} cannot be read: {reason}") from error
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise MeshError(
            f"volume {str(path)!r} must have 3 dimensions and 1 value a voxel, got "
            f"{image.GetDimension()} and {image.GetNumberOfComponentsPerPixel()}"
        )
    return Volume(
        itk.GetArrayFromImage(image).T,
        threshold,
        _MILLIMETRE * np.array(image.GetSpacing()),
        _MILLIMETRE * np.array(image.GetOrigin()),
        np.array(image.GetDirection()).reshape(3, 3),
    )
