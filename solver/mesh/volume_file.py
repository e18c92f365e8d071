"""Volumes of voxels from files: NIfTI, DICOM series, NRRD, and whatever else SimpleITK reads; arrays of NumPy."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import PATH, checked
from ..errors import MeshError
from .volume import Volume

VOLUME_ENDINGS = (".npy", ".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm")

_MILLIMETRE = 1e-3  # the unit of scans


def is_volume(path: str | Path) -> bool:
    """Whether a path is that of a volume, by its ending, or a folder, as a DICOM series is."""
    return str(path).lower().endswith(VOLUME_ENDINGS) or Path(path).is_dir()


@checked(MeshError, path=PATH)
def load_volume(
    path: str | Path,
    threshold: float,
    spacing: float | ArrayLike | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> Volume:
    """Read a volume: a NIfTI or NRRD file, the folder of a DICOM series, or a .npy with its spacing.

    A scan's own millimetres, places and directions are kept, in metres: x, y and z go to the patient's left, back and
    head, in DICOM, NRRD and NIfTI alike. All but .npy need the package SimpleITK (extra `medical`).

    Parameters
    ----------
    path : path
    threshold : float
        Value at the body's surface, in the file's units: about 300 Hounsfield units for bone, -300 for skin.
    spacing : float or [3], optional
        Between the nodes of a .npy, whose array is [i, j, k] along x, y and z [m]; a scan has its own.
    origin : [3]
        Where the first node of a .npy is [m].

    Raises
    ------
    MeshError
        If the file cannot be read, SimpleITK is missing, or the spacing of a .npy is.
    """
    path = Path(path)
    if not path.exists():
        raise MeshError(f"volume {str(path)!r} does not exist; valid are {', '.join(VOLUME_ENDINGS)}, or a folder")
    if not is_volume(path):
        raise MeshError(f"volume {str(path)!r} has an unknown ending; valid are {', '.join(VOLUME_ENDINGS)}")
    if path.suffix.lower() != ".npy":
        if spacing is not None:
            raise MeshError(f"volume {str(path)!r} has a spacing of its own; leave it out, it is for .npy files")
        return _scan(path, threshold)
    if spacing is None:
        raise MeshError(f"volume {str(path)!r} needs a spacing: the way between voxels in metres, such as 0.001")
    return Volume(_array(path), threshold, spacing, origin)


def _array(path: Path) -> NDArray:
    try:
        values = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise MeshError(f"volume {str(path)!r} cannot be read: {error}") from error
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "iuf":
        raise MeshError(f"volume {str(path)!r} holds no numbers; valid is an array [i, j, k]")
    return values


def _scan(path: Path, threshold: float) -> Volume:
    try:
        itk: Any = importlib.import_module("SimpleITK")
    except ImportError as error:
        raise MeshError(
            f"volume {str(path)!r} needs the package SimpleITK: pip install 'ripple-sim[medical]', or save the voxels "
            "as .npy"
        ) from error
    itk.ProcessObject.SetGlobalWarningDisplay(False)  # its readers write to stderr beside what they raise
    try:
        names: Any = str(path)
        if path.is_dir():
            names = itk.ImageSeriesReader.GetGDCMSeriesFileNames(str(path))
            if not names:
                raise MeshError(f"folder {str(path)!r} holds no DICOM series; give one that does, or a volume's file")
        image = itk.ReadImage(names)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].removeprefix("sitk::ERROR: ")
        raise MeshError(f"volume {str(path)!r} cannot be read: {reason}") from error
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise MeshError(
            f"volume {str(path)!r} has {image.GetDimension()} dimensions and {image.GetNumberOfComponentsPerPixel()} "
            "values a voxel; valid are 3 and 1"
        )
    return Volume(
        itk.GetArrayFromImage(image).T,
        threshold,
        _MILLIMETRE * np.array(image.GetSpacing()),
        _MILLIMETRE * np.array(image.GetOrigin()),
        np.array(image.GetDirection()).reshape(3, 3),
    )
