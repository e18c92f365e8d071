"""Atlases on disk: saved, loaded, refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import Atlas, AtlasError, SphereAtlas, load_atlas, sphere_atlas
from ripple_sim.solver.texels.atlas import FORMAT


def test_save_and_load(animal: Atlas, tmp_path: Path) -> None:
    animal.save(tmp_path / "deep" / "animal.npz")
    loaded = load_atlas(tmp_path / "deep" / "animal.npz")
    for name in ("positions", "normals", "triangles", "barycentrics", "sphere"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(animal, name))
    sphere_atlas(3.0, 8).save(tmp_path / "sphere.npz")
    assert isinstance(load_atlas(tmp_path / "sphere.npz"), SphereAtlas)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deep", "sphere.npz"]


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "atlas.npz"
    sphere_atlas(1.0, 8).save(path)
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole[:3000] + b"\x00" * 50 + whole[3050:], b"PK\x03\x04 nonsense"):
        path.write_bytes(damaged)
        with pytest.raises(AtlasError, match="make it again"):
            load_atlas(path)
    np.savez(path, V=np.zeros((3, 3)), format=np.array([FORMAT]))
    with pytest.raises(AtlasError, match="not an atlas, or of another version"):
        load_atlas(path)


def test_files_of_another_version_are_refused(animal: Atlas, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    animal.save(tmp_path / "atlas.npz")
    monkeypatch.setattr("ripple_sim.solver.texels.atlas.FORMAT", FORMAT + 1)
    with pytest.raises(AtlasError, match="another version"):
        load_atlas(tmp_path / "atlas.npz")
    with pytest.raises(AtlasError, match="does not exist"):
        load_atlas(tmp_path / "missing.npz")
