"""Frames by Cycles: Blender's settings, its frames, and messages where it fails.

A small program stands in for Blender, which few machines that run the tests have.
"""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image
from programs import PROGRAMS
from scene_files import write_scene

from ripple_sim import VideoOptions, load_scene
from ripple_sim.cycles import PYTHON, check_cycles, render_cycles
from ripple_sim.errors import RippleError, RippleWarning, VideoError
from ripple_sim.render import tone_mapped

pytest.importorskip("pxr")

MODEL = """<mujoco><worldbody><light pos="1 0 2" dir="-1 0 -2" diffuse="1 1 1"/>
<geom type="plane" name="ground" size="9 9 .1" rgba="1 1 1 1"/>
<geom name="egg" size="0.2" pos="0 0 0.2"/><body pos="0 0 0.6"><freejoint/><geom size="0.05"/>
</body>
</worldbody></mujoco>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    table = (
        'model = "scene.xml"\nduration = 0.1\n[[ripple]]\ngeom = "egg"\nresolution = 8\nlook '
        "= "
        '"jelly"\n'
    )
    write_scene(tmp_path, MODEL, table + "material = {speed = 0.3, density = 1000.0}\n")
    return tmp_path


def stand_in(
    folder: Path, monkeypatch: pytest.MonkeyPatch, fails: int = -1, version: str = "5 0 1"
) -> None:
    source = (PROGRAMS / "stand_in_for_blender.py").read_text()
    program = folder / "blender"
    program.write_text(f"#!{sys.executable}\n{source}")
    monkeypatch.setenv("BPY_VERSION", version)
    monkeypatch.setenv("SETTINGS_COPY", str(folder / "told.json"))
    monkeypatch.setenv("FAILING_FRAME", str(fails))
    program.chmod(0o755)
    monkeypatch.setenv(PYTHON, str(program))


def test_frames_come_back_in_order_and_tone_mapped(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(folder, monkeypatch)
    options = VideoOptions(size=(64, 36), fps=20)
    summary = render_cycles(
        load_scene(folder / "scene.toml"), folder / "frames", options, samples=4
    )
    shown = [np.asarray(Image.open(file)) for file in sorted((folder / "frames").glob("*.png"))]
    assert summary.frames == len(shown) == 2
    assert not shown[0].any()
    assert (shown[1] == np.rint(255 * tone_mapped(np.full((36, 64, 3), np.float32(0.2))))).all()
    told = json.loads((folder / "told.json").read_text())
    assert (told["samples"], told["floor"], told["fps"]) == (4, "ground", 20)
    assert not Path(told["folder"]).exists()


def test_the_stage_keeps_properties_that_preview_surfaces_lack(folder: Path) -> None:
    from pxr import Usd

    from ripple_sim import ExportOptions, export_scene

    export_scene(
        load_scene(folder / "scene.toml"), folder / "run.usda", ExportOptions(fps=20, duration=0.05)
    )
    stage = Usd.Stage.Open(str(folder / "run.usda"))
    prims = [prim for prim in stage.Traverse() if prim.HasAttribute("userProperties:translucency")]
    kept = {prim.GetAttribute("userProperties:translucency").Get() for prim in prims}
    assert max(kept) == pytest.approx(0.7)
    lamps = [prim for prim in stage.Traverse() if prim.HasAttribute("userProperties:power")]
    assert {prim.GetParent().GetName() for prim in lamps} == {"lights"}
    assert all(prim.GetAttribute("userProperties:power").Get() > 0 for prim in lamps)


@pytest.mark.filterwarnings("ignore:MuJoCo. Insufficient arena memory")
def test_mujocos_warnings_of_the_first_frame_are_ours(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = '<body pos="1 0 1"><freejoint/><geom size="0.1"/></body>'
    small = MODEL.replace("<mujoco>", '<mujoco><size memory="300K"/>')
    (folder / "scene.xml").write_text(small.replace("</worldbody>", f"{40 * ball}</worldbody>"))
    scene = load_scene(folder / "scene.toml")
    mujoco.set_mju_user_warning(None)
    stand_in(folder, monkeypatch, fails=0)
    monkeypatch.chdir(folder)
    with (
        pytest.warns(RippleWarning, match="MuJoCo: Too many contacts"),
        pytest.raises(VideoError, match="frame 0"),
    ):
        render_cycles(scene, folder / "frames", VideoOptions(size=(64, 36), fps=20, duration=0.05))
    assert not (folder / "MUJOCO_LOG.TXT").exists()


def test_a_blender_that_fails_leaves_no_video(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(folder, monkeypatch, fails=1)
    options = VideoOptions(size=(64, 36), fps=20)
    with pytest.raises(VideoError, match=r"ended before frame 1 with status 1: out of memory"):
        render_cycles(load_scene(folder / "scene.toml"), folder / "frames", options)
    assert not list(folder.glob("frames*"))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"overlay": ("height",)}, "has no --overlay"),
        ({"transparent": True}, "has no --transparent"),
        ({"compare": "paper"}, "has no --compare"),
    ],
    ids=["overlay", "transparent", "compare"],
)
def test_options_that_cycles_does_not_have_are_refused(
    given: dict, said: str, tmp_path: Path
) -> None:
    with pytest.raises(RippleError, match=said):
        check_cycles(VideoOptions(**given), tmp_path / "a.webp")


def test_a_blender_that_cannot_be_used_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(said: str) -> None:
        with pytest.raises(VideoError, match=said) as refusal:
            check_cycles(VideoOptions(), tmp_path / "a.mp4")
        assert "\n" not in str(refusal.value)

    monkeypatch.setenv(PYTHON, str(tmp_path / "none"))
    refused("cannot be run")
    stand_in(tmp_path, monkeypatch, version="4 4 0")
    refused(r"must have bpy 5\.0 or later, got 4\.4\.0: .*'bpy>=5\.0'")
    monkeypatch.setenv(PYTHON, str(program := tmp_path / "python"))
    program.write_text(f"#!{sys.executable}\nraise ImportError('libSM.so.6: no such file')\n")
    program.chmod(0o755)
    refused(r"cannot import bpy: ImportError: libSM\.so\.6")
    monkeypatch.delenv(PYTHON)
    monkeypatch.setitem(sys.modules, "bpy", None)
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "bpy" else object()
    )
    refused(r"pip install 'ripple-sim\[cycles\]'")
