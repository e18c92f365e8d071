"""The same ball from volumes in NumPy, NIfTI, NRRD and DICOM, however the grid lies."""

import sys
from pathlib import Path

import numpy as np
import pytest
import SimpleITK

from ripple_sim.solver import MeshError, load_volume

# m, in the patient's frame
CENTRE = np.array([0.02, -0.03, 0.05])
RADIUS = 0.012
SPACING = np.array([0.002, 0.0015, 0.003])
ORIGIN = np.array([0.0, -0.05, 0.03])
# i goes to the back, j to the right, k to the head
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def scan(directions: np.ndarray, origin: np.ndarray) -> SimpleITK.Image:
    """A ball of bone in soft tissue, as a scanner's grid has it."""
    nodes = (
        np.stack(np.meshgrid(*map(np.arange, (20, 27, 14)), indexing="ij"), axis=-1)
        * SPACING
        @ directions.T
    )
    depth = RADIUS - np.linalg.norm(nodes + origin - CENTRE, axis=-1)
    image = SimpleITK.GetImageFromArray(np.clip(4e5 * depth + 300, -1000, 3000).astype(np.int16).T)
    image.SetSpacing((1e3 * SPACING).tolist())
    image.SetOrigin((1e3 * origin).tolist())
    image.SetDirection(directions.ravel().tolist())
    return image


def write_series(image: SimpleITK.Image, folder: Path) -> None:
    """A DICOM series: a file a slice, whose names are not in the order of their places."""
    folder.mkdir()
    writer = SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for k in range(image.GetDepth()):
        flat = image[:, :, k]
        position = image.TransformIndexToPhysicalPoint((0, 0, k))
        tags = {
            "0020|000e": "1.2.3.4",
            "0020|0032": "\\".join(map(str, position)),
            "0008|0060": "CT",
        }
        tags |= {
            "0020|0037": "\\".join(
                map(str, np.reshape(image.GetDirection(), (3, 3))[:, :2].T.ravel())
            )
        }
        for tag, value in (tags | {"0020|0013": str(k), "0018|0050": "3"}).items():
            flat.SetMetaData(tag, value)
        writer.SetFileName(str(folder / f"{(5 * k) % 14:02}.dcm"))
        writer.Execute(flat)


@pytest.mark.parametrize("ending", ["nii.gz", "nrrd", "dicom"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_scan_lies_where_the_patient_lay_in_metres(
    tmp_path: Path, ending: str, turned: bool
) -> None:
    directions = TURNED if turned else np.eye(3)
    image = scan(directions, np.array([0.04, -0.05, 0.03]) if turned else ORIGIN)
    path = tmp_path / ending
    if ending == "dicom":
        write_series(image, path)
    else:
        path = tmp_path / f"ball.{ending}"
        SimpleITK.WriteImage(image, str(path))
    V, F = load_volume(path, 300).surface()
    away = np.linalg.norm(V - CENTRE, axis=1)
    assert np.abs(away / RADIUS - 1).max() < 0.03
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    assert ((normals * (V[F].mean(axis=1) - CENTRE)).sum(axis=1) >= -1e-12).all()  # outwards
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(
        4 * np.pi * RADIUS**2, rel=0.05
    )


def test_an_array_of_numpy_takes_its_spacing_and_place_from_the_caller(tmp_path: Path) -> None:
    image = scan(np.eye(3), ORIGIN)
    np.save(tmp_path / "ball.npy", SimpleITK.GetArrayFromImage(image).T)
    SimpleITK.WriteImage(image, str(tmp_path / "ball.nrrd"))
    own = load_volume(tmp_path / "ball.npy", 300, SPACING, ORIGIN).surface()
    for mine, other in zip(own, load_volume(tmp_path / "ball.nrrd", 300).surface(), strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-12)


def test_invalid_volumes_are_refused_with_the_expected_values(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.save(tmp_path / "plain.npy", np.zeros((2, 2, 2)))
    np.save(tmp_path / "words.npy", np.array(["a", "b"]))
    (tmp_path / "broken.nii").write_bytes(b"no scan")
    (tmp_path / "broken.npy").write_bytes(b"")
    (tmp_path / "mesh.obj").write_text("v 0 0 0")
    (tmp_path / "empty").mkdir()
    for name, spacing, message in [
        ("absent.nii", None, "does not exist"),
        ("mesh.obj", None, "unknown ending: it must end in .npy, .nii"),
        ("plain.npy", None, "needs a spacing"),
        ("broken.nii", 0.1, "a spacing of its own"),
        ("broken.nii", None, "cannot be read"),
        ("broken.npy", 0.1, "cannot be read"),
        ("words.npy", 0.1, "must hold an array of numbers"),
        ("empty", None, "holds no DICOM series"),
    ]:
        with pytest.raises(MeshError, match=message):
            load_volume(tmp_path / name, 0.5, spacing)
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(MeshError, match=r"pip install 'ripple-sim\[medical\]'"):
        load_volume(tmp_path / "broken.nii", 0.5)
