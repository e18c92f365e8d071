"""Textures of a mesh file in the files of other programs: opacity, holes and emission."""

import json
import re
import struct
from pathlib import Path
from typing import Any

import pytest
from gltf_files import SQUARE_UV, Gltf

from ripple_sim import ExportOptions, export_scene
from ripple_sim.scene import Scene, drop_scene

OPTIONS = ExportOptions(fps=10, duration=0.1, resolution=12, backend="cpu")


def square_of(folder: Path, opacities: list[int]) -> Scene:
    """A square, whose image has pixels of some opacities beside each other, above an opaque one."""
    file = Gltf()
    image = file.texture([[[255, 0, 0, opacity] for opacity in opacities]])
    clear = file.add(
        "materials",
        alphaMode="BLEND",
        pbrMetallicRoughness={"baseColorTexture": {"index": image}},
    )
    uv = file.accessor(SQUARE_UV)
    file.show(file.primitive(TEXCOORD_0=uv, material=clear))
    return drop_scene(file.write(folder / "a.glb"), bodies=0)


def materials_of(path: Path) -> list[dict[str, Any]]:
    """The materials in the JSON of a .glb file."""
    content = path.read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    return json.loads(content[20 : 20 + length])["materials"]


def test_usd_has_opacity_or_a_threshold_for_holes(tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr")
    thresholds = []
    for opacities in ([100, 255], [0, 255]):
        path = tmp_path / f"{opacities[0]}.usda"  # USD opens no path twice
        export_scene(square_of(tmp_path, opacities), path, OPTIONS)
        stage = pxr.Usd.Stage.Open(str(path))
        mesh = next(each for each in stage.Traverse() if each.GetName() == "target")
        material, _ = pxr.UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        surface = material.ComputeSurfaceSource()[0]
        assert surface.GetInput("opacity").HasConnectedSource()
        threshold = surface.GetInput("opacityThreshold")
        thresholds.append(threshold.Get() if threshold else None)
    assert thresholds == [None, 0.5]


def test_glb_is_blended_or_a_mask(tmp_path: Path) -> None:
    modes = []
    for opacities in ([100, 255], [0, 255], [255, 255]):
        scene = square_of(tmp_path, opacities)
        export_scene(scene, tmp_path / "run.glb", OPTIONS)
        materials = materials_of(tmp_path / "run.glb")
        (shown,) = (
            each for each in materials if "baseColorTexture" in each["pbrMetallicRoughness"]
        )
        modes.append(shown.get("alphaMode", "OPAQUE"))
    assert modes == ["BLEND", "MASK", "OPAQUE"]


def test_pages_cast_shadows_of_what_is_more_than_half_opaque(tmp_path: Path) -> None:
    seen = []
    for opacities in ([100, 100], [0, 255], [255, 255]):
        export_scene(square_of(tmp_path, opacities), tmp_path / "a.html", OPTIONS)
        text = (tmp_path / "a.html").read_text(encoding="utf-8")
        target = re.search(r'\{"name": ?"target".*?"textured": ?\w+', text)
        assert target is not None
        meta = json.loads(target.group() + "}")
        seen.append((meta["clear"], meta["casting"] / meta["triangles"]))
    assert seen == [(True, 0.0), (False, pytest.approx(0.5, abs=0.1)), (False, 1.0)]


def test_emission_has_an_image_of_its_own(tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr")
    file = Gltf()
    material = file.add("materials", emissiveFactor=[1, 0, 0])
    file.show(file.primitive(material=material))
    scene = drop_scene(file.write(tmp_path / "a.glb"), bodies=0)
    for name in ("glow.glb", "glow.usda", "glow.html"):
        export_scene(scene, tmp_path / name, OPTIONS)
    stage = pxr.Usd.Stage.Open(str(tmp_path / "glow.usda"))
    mesh = next(each for each in stage.Traverse() if each.GetName() == "target")
    bound, _ = pxr.UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    assert bound.ComputeSurfaceSource()[0].GetInput("emissiveColor").HasConnectedSource()
    assert any("emissiveTexture" in each for each in materials_of(tmp_path / "glow.glb"))
    assert '"glow": 1' in (tmp_path / "glow.html").read_text(encoding="utf-8").replace(":1", ": 1")
