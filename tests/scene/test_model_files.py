"""Models that MuJoCo would wait for, or take though they are senseless, are refused with a reason."""

import os
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.scene.load_scene import check_files, load_model, load_scene

BALL = '<worldbody><body><freejoint/><geom name="ball" type="sphere" size="1"/></body></worldbody>'


@pytest.fixture(autouse=True)
def _no_hang() -> Iterator[None]:
    signal.alarm(60)
    yield
    signal.alarm(0)


def scene(folder: Path, model: str) -> Path:
    (folder / "model.xml").write_text(f"<mujoco>{model}</mujoco>")
    (folder / "scene.toml").write_text('model = "model.xml"\n[[ripple]]\ngeom = "ball"\n')
    return folder / "scene.toml"


@pytest.mark.parametrize(
    "model",
    [
        '<include file="pipe"/>',
        '<include file="part.xml"/>',
        '<asset><mesh name="m" file="pipe"/></asset>',
        '<compiler assetdir="deep"/><asset><texture type="2d" name="t" file="pipe2"/></asset>',
        '<asset><texture type="cube" name="t" fileup="pipe"/></asset>',
    ],
)
def test_a_fifo_anywhere_in_a_model_is_refused(tmp_path: Path, model: str) -> None:
    (tmp_path / "deep").mkdir()
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "deep" / "pipe2")
    (tmp_path / "part.xml").write_text('<mujoco><include file="pipe"/></mujoco>')
    with pytest.raises(SceneError, match=r"pipe2?' *.*not a regular file"):
        load_scene(scene(tmp_path, model + BALL))


def test_includes_that_go_round_and_broken_ones_are_left_to_mujoco(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text('<mujoco><include file="a.xml"/><include file="b.xml"/></mujoco>')
    (tmp_path / "b.xml").write_text("<mujoco")
    check_files(tmp_path / "a.xml")
    with pytest.raises(SceneError, match="MuJoCo refuses"):
        load_model(tmp_path / "a.xml")


@pytest.mark.parametrize("step", ["0", "-0.002", "inf", "nan", "1e300"])
def test_a_senseless_time_step_is_refused(tmp_path: Path, step: str) -> None:
    with pytest.raises(SceneError, match=r"timestep is .* s; valid is a number greater than 0 and up to 1"):
        load_scene(scene(tmp_path, f'<option timestep="{step}"/>{BALL}'))


def test_a_keyframe_of_another_size_is_refused(tmp_path: Path) -> None:
    key = '<keyframe><key name="start" qpos="{}"/></keyframe>'
    with pytest.raises(SceneError, match=r"keyframe 'start' .* has 2 positions \(qpos\); valid are 7"):
        load_scene(scene(tmp_path, BALL + key.format("1 2")))
    assert load_scene(scene(tmp_path, BALL + key.format("0 0 2 1 0 0 0"))).model.nkey == 1


def test_a_keyframe_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    key = '<keyframe><key/><key qvel="0 0 nan 0 0 0"/></keyframe>'
    with (
        pytest.warns(RippleWarning, match="NaN"),
        pytest.raises(SceneError, match=r"keyframe 1 of .* holds NaN or inf; valid are finite numbers"),
    ):
        load_scene(scene(tmp_path, BALL + key))


def test_more_memory_than_there_is_names_the_setting(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r'allocate memory; name in the MJCF how much .* <size memory="4G"/>'):
        load_scene(scene(tmp_path, f'<size memory="100000000G"/>{BALL}'))


def test_a_scene_file_that_is_a_fifo_is_named_as_what_it_is(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scene.toml")
    with pytest.raises(SceneError, match=r"scene\.toml' is not a regular file"):
        load_scene(tmp_path / "scene.toml")


def test_what_mujoco_warns_of_is_our_warning_and_litters_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = scene(tmp_path, f'<option timestep="nan"/>{BALL}')
    with pytest.warns(RippleWarning, match="MuJoCo: XML contains a 'NaN'"), pytest.raises(SceneError, match="timestep"):
        load_scene(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no exception passes through MuJoCo
        with pytest.raises(SceneError, match="timestep"):
            load_scene(path)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["model.xml", "scene.toml"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("reference", ["&#0;", "&#x00;"])
def test_names_with_a_nul_are_refused_rather_than_cut(tmp_path: Path, reference: str) -> None:
    model = tmp_path / "model.xml"
    model.write_text(f'<mujoco><worldbody>\n<geom name="e{reference}gg" size="1"/></worldbody></mujoco>')
    with pytest.raises(SceneError, match=r"model\.xml.* line 2, .*NUL"):
        check_files(model)
