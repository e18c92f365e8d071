"""An exporter refuses bad outputs, and leaves nothing behind after errors."""

import importlib.util
import shutil
from pathlib import Path
from typing import Any

import mujoco
import pytest
from mujoco_models import forwarded, posed

from ripple_sim import Exporter, Material, RippleError, Ripples, RippleWarning

pytest.importorskip("pxr")


def export(ripples: Ripples, path: Path, **options: Any) -> None:
    with Exporter(ripples.model, ripples, path, tessellation="own", **options) as exporter:
        exporter.write(forwarded(ripples.model))


@pytest.mark.parametrize("name", ["run.obj", "run", ".usdc"])
def test_unknown_endings_name_the_valid_ones(ripples: Ripples, tmp_path: Path, name: str) -> None:
    with pytest.raises(
        RippleError, match=r"\.usdc, \.usda, \.usdz, \.zarr, \.html, \.csv, \.parquet"
    ):
        export(ripples, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_missing_packages_are_named(
    ripples: Ripples, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RippleError, match=r"pip install 'ripple-sim\[usd\]'"):
        export(ripples, tmp_path / "run.usdc")


@pytest.mark.parametrize("name", ["run.usdc", "run.usda", "run.usdz", "run.csv", "run.parquet"])
def test_our_files_are_replaced_and_foreign_files_only_with_overwrite(
    ripples: Ripples, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    export(ripples, path)
    export(ripples, path)
    path.write_text("#usda 1.0\n")
    with pytest.raises(RippleError, match="--overwrite"):
        export(ripples, path)
    assert path.read_text() == "#usda 1.0\n"
    export(ripples, path, overwrite=True)
    assert path.stat().st_size > 50
    assert {each.name for each in tmp_path.iterdir()} <= {name, "run.textures"}


def test_folders_of_other_things_are_never_replaced(ripples: Ripples, tmp_path: Path) -> None:
    export(ripples, store := tmp_path / "run.zarr")
    export(ripples, store)
    (store / "thesis.txt").write_text("mine")
    with pytest.raises(RippleError, match="folder of other things"):
        export(ripples, store, overwrite=True)
    assert (store / "thesis.txt").read_text() == "mine"
    (store / ".zattrs").write_text("[" * 100_000)
    with pytest.raises(RippleError, match="folder of other things"):
        export(ripples, store, overwrite=True)
    shutil.rmtree(store)
    (tmp_path / "run.textures").mkdir()
    (tmp_path / "run.textures" / "texture_0.png").write_text("mine")
    with pytest.raises(RippleError, match="other files"):
        export(ripples, tmp_path / "run.usdc")
    assert (tmp_path / "run.textures" / "texture_0.png").read_text() == "mine"
    assert [each.name for each in tmp_path.iterdir()] == ["run.textures"]


def test_nothing_is_left_after_an_exception_and_an_earlier_file_stays(
    ripples: Ripples, tmp_path: Path
) -> None:
    export(ripples, path := tmp_path / "run.usdc")
    before = path.read_bytes()
    data = mujoco.MjData(ripples.model)
    with pytest.raises(KeyboardInterrupt), Exporter(ripples.model, ripples, path) as exporter:
        exporter.write(data)
        raise KeyboardInterrupt
    assert path.read_bytes() == before
    assert {each.name for each in tmp_path.iterdir()} == {"run.usdc", "run.textures"}
    with pytest.raises(RippleError, match="closed"):
        exporter.write(data)


def test_a_file_without_frames_is_refused(ripples: Ripples, tmp_path: Path) -> None:
    with (
        pytest.raises(RippleError, match="at least one"),
        Exporter(ripples.model, ripples, tmp_path / "run.usdc"),
    ):
        pass
    assert not list(tmp_path.iterdir())


def test_one_warning_that_a_page_shows_an_orthographic_camera_in_perspective(
    tmp_path: Path,
) -> None:
    xml = """<mujoco><worldbody><geom name="ball" size=".3"/>
    <camera name="flat" pos="0 -2 0" xyaxes="1 0 0 0 0 1"
        projection="orthographic" fovy="1"/></worldbody></mujoco>"""
    model, data = posed(xml)
    ripples = Ripples(
        model, {"ball": Material(speed=1.0, density=1.0)}, resolution=8, backend="cpu"
    )
    page = Exporter(model, ripples, tmp_path / "run.html", camera="flat")
    with (
        page as exporter,
        pytest.warns(RippleWarning, match="the page shows the camera in perspective") as told,
    ):
        exporter.write(data)
        exporter.write(data)
    assert len(told) == 1
