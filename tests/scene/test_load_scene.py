"""Scene files and models are found, edited, varied, or refused in one line."""

import os
import re
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scene_files import write_scene

from ripple_sim import RippleError, Simulation
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.scene import check_files, load_model, load_scene, refusal_of

MJCF = """<mujoco><worldbody><geom name="egg" size="0.1"/>
<body name="stone" pos="0 0 1"><freejoint/><geom size="0.05"/></body>
<body name="brick" pos="1 0 1"><freejoint/><geom size="0.05"/></body></worldbody></mujoco>"""
TOML = """model = "models/scene.xml"
[[ripple]]
geom = "egg"
[[drop]]
body = "stone"
time = 0.1
position = [1, 2, 3]
[[drop]]
body = "brick"
time = 0.1
[[throw]]
body = "stone"
time = 0.2
velocity = [0, 0, 1]
position = [4, 5, 6]
[[place]]
body = "stone"
time = 0.3
position = [7, 8, 9]
"""


def written(folder: Path, toml: str = TOML) -> Path:
    (folder / "models").mkdir()
    (folder / "models" / "scene.xml").write_text(MJCF)
    (folder / "pond.toml").write_text(toml)
    return folder / "pond.toml"


def test_the_model_lies_relative_to_the_scene_file_wherever_it_is_read_from(
    tmp_path, monkeypatch
) -> None:
    path = written(tmp_path)
    monkeypatch.chdir(tmp_path / "models")
    for name in (path, str(path), "../pond.toml"):
        scene = load_scene(name)
        assert (scene.name, scene.model.ngeom) == ("pond", 3)


def test_drops_and_throws_are_shifted_with_their_bodies_and_places_stay(tmp_path) -> None:
    scene = load_scene(written(tmp_path, TOML + "[random]\nposition = 0.3\nseed = 5\n"))
    shift = scene.model.body("stone").pos - [0, 0, 1]
    assert 0 < np.abs(shift).max() <= 0.3
    stone, brick = scene.events.drop
    np.testing.assert_allclose(stone.position, np.add([1, 2, 3], shift))
    assert brick.position is None
    np.testing.assert_allclose(scene.events.throw[0].position, np.add([4, 5, 6], shift))
    assert scene.events.place[0].position == (7, 8, 9)


def test_a_given_seed_replaces_the_files_seed_and_needs_a_random_table(tmp_path) -> None:
    path = written(tmp_path, TOML + "[random]\nposition = 0.3\nseed = 5\n")
    own, same, other = (load_scene(path, seed=seed).model.body_pos for seed in (None, 5, 6))
    np.testing.assert_array_equal(own, same)
    assert not np.array_equal(own, other)
    path.write_text(TOML)
    with pytest.raises(SceneError, match=r"has no \[random\], so nothing follows the seed 6"):
        load_scene(path, seed=6)


def test_edit_runs_after_randomisation_and_before_compilation(tmp_path) -> None:
    seen = []

    def edit(spec: mujoco.MjSpec) -> None:
        seen.append(spec.body("stone").pos.copy())
        spec.worldbody.add_geom(name="new", size=[0.2, 0, 0])

    scene = load_scene(written(tmp_path, TOML + "[random]\nposition = 0.3\n"), edit)
    assert scene.model.geom("new").size[0] == 0.2
    np.testing.assert_allclose(seen, [scene.model.body("stone").pos])
    assert not np.allclose(seen, [0, 0, 1])


@pytest.mark.parametrize(
    ("name", "advice"), [("egg.OBJ", "`ripple-sim drop`"), ("scene.xml", "as its `model`")]
)
def test_message_says_that_a_mesh_or_a_model_is_no_scene(tmp_path, name: str, advice: str) -> None:
    (tmp_path / name).write_text("v 0 0 0")
    with pytest.raises(SceneError, match=f"{name}.*, not a scene; .*{advice}"):
        load_scene(tmp_path / name)


def test_messages_distinguish_missing_files_from_folders(tmp_path) -> None:
    with pytest.raises(
        SceneError, match=r"there is no scene .*; shipped scenes are .*duck.*path of a TOML file"
    ):
        load_scene(tmp_path)
    with pytest.raises(
        SceneError, match=r"none.xml' does not exist; `model` names it, relative to the scene file"
    ):
        load_model(tmp_path / "none.xml")
    with pytest.raises(SceneError, match="is not a file"):
        load_model(tmp_path)


def test_mujocos_reason_is_given_in_one_line_and_other_errors_pass() -> None:
    with (
        pytest.raises(SceneError, match=r"^MuJoCo refuses 'a\.xml': first second$") as error,
        refusal_of("'a.xml'"),
    ):
        raise ValueError("first\n   second\n")
    assert isinstance(error.value.__cause__, ValueError)
    with pytest.raises(KeyError), refusal_of("'a.xml'"):
        raise KeyError("first")


LINK = """<mujoco><worldbody><body name="link">
<geom name="shell" size="0.3" contype="0" conaffinity="0"/><geom name="core" size="0.29"/>
<geom size="0.1"/></body>
<body name="ball" pos="0 0 0.36"><freejoint/><geom name="ball" size="0.05"/></body></worldbody>
</mujoco>"""


def test_a_scene_names_geoms_by_their_place_and_those_that_collide_for_a_target(
    tmp_path: Path,
) -> None:
    target = (
        'model = "scene.xml"\n[[ripple]]\ngeom = "link/0"\nresolution = 8\ncontacts = ["core"]\n'
    )
    poke = '[[poke]]\ngeom = "link/0"\ntime = 0.0\npoint = [0, 0, 0.3]\nimpulse = 0.1\n'
    simulation = Simulation(load_scene(write_scene(tmp_path, LINK, target + poke)), backend="cpu")
    assert list(simulation.ripples) == ["shell"]
    while simulation.data.time < 0.2:
        simulation.advance_frame()
    assert {(each.geom, each.other) for each in simulation.impulses} == {("shell", "ball")}


def test_impossible_contacts_are_refused_when_the_scene_is_read(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path, LINK, 'model = "scene.xml"\n[[ripple]]\ngeom = "shell"\ncontacts = ["ball"]\n'
    )
    with pytest.raises(RippleError, match="got geom 'ball' on body 'ball', which moves by itself"):
        load_scene(path)


BALL = '<worldbody><body><freejoint/><geom name="ball" type="sphere" size="1"/></body></worldbody>'


@pytest.fixture(autouse=True)
def _no_hang() -> Iterator[None]:
    signal.alarm(60)
    yield
    signal.alarm(0)


def ball_scene(folder: Path, model: str) -> Path:
    return write_scene(
        folder, f"<mujoco>{model}</mujoco>", 'model = "scene.xml"\n[[ripple]]\ngeom = "ball"\n'
    )


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
        load_scene(ball_scene(tmp_path, model + BALL))


def test_circular_and_broken_includes_are_left_to_mujoco(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(
        '<mujoco><include file="a.xml"/><include file="b.xml"/></mujoco>'
    )
    (tmp_path / "b.xml").write_text("<mujoco")
    check_files(tmp_path / "a.xml")
    with pytest.raises(SceneError, match="MuJoCo refuses"):
        load_model(tmp_path / "a.xml")


# as measured [s]
@pytest.mark.parametrize(
    ("count", "seconds"), [("20 20 20", 5.7), ("24 24 24", 25), ("125 120", 32), ("30 30 30", 133)]
)
def test_warning_about_a_flex_that_mujoco_takes_long_to_set_up(
    tmp_path: Path, count: str, seconds: float
) -> None:
    (tmp_path / "flex.xml").write_text(
        f'<mujoco><worldbody><flexcomp name="f" count="{count}"/></worldbody></mujoco>'
    )
    with warnings.catch_warnings(record=True) as told:
        check_files(tmp_path / "flex.xml")
    said = [
        int(re.search(r"MuJoCo takes about (\d+) s to set up", str(each.message))[1])
        for each in told
    ]
    assert said == ([pytest.approx(seconds, rel=0.2)] if seconds > 10 else [])
    assert all(each.category is RippleWarning for each in told)


STEP = r"timestep must be greater than 0 and up to 1"
KEY = '<keyframe><key/><key name="start" {}/></keyframe>'


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        *(
            (f'<option timestep="{step}"/>', STEP)
            for step in ("0", "-0.002", "inf", "nan", "1e300")
        ),
        (KEY.format('qpos="1 2"'), r"keyframe 'start' .* must have 7 positions \(qpos\).*, got 2"),
        (
            KEY.format('qvel="0 0 nan 0 0 0"'),
            "keyframe 'start' of .* must hold finite numbers, got NaN or inf",
        ),
        (
            '<keyframe><key/><key qpos="0 0 nan 1 0 0 0"/></keyframe>',
            "keyframe 1 of .* must hold finite numbers",
        ),
        (
            '<size memory="100000000G"/>',
            r'allocate memory; name in the MJCF how much .* <size memory="4G"/>',
        ),
    ],
)
def test_a_model_with_an_invalid_setting_is_refused(
    tmp_path: Path, setting: str, message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene(ball_scene(tmp_path, setting + BALL))
    assert (
        load_scene(ball_scene(tmp_path, BALL + KEY.format('qpos="0 0 2 1 0 0 0"'))).model.nkey == 2
    )


def test_a_scene_file_that_is_a_fifo_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scene.toml")
    with pytest.raises(SceneError, match=r"scene\.toml' is not a regular file"):
        load_scene(tmp_path / "scene.toml")


def test_mujocos_warnings_become_ours_and_no_log_file_is_written(
    tmp_path, monkeypatch, capfd
) -> None:
    monkeypatch.chdir(tmp_path)
    path = ball_scene(tmp_path, f'<option magnetic="nan 0 0"/>{BALL}')
    with pytest.warns(RippleWarning, match="MuJoCo: XML contains a 'NaN'"):
        load_scene(path)
    # an error of ours comes without MuJoCo's warning
    with warnings.catch_warnings(action="error"), pytest.raises(SceneError, match="timestep"):
        load_scene(ball_scene(tmp_path, f'<option timestep="nan"/>{BALL}'))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["scene.toml", "scene.xml"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("reference", ["&#0;", "&#x00;"])
def test_names_with_a_nul_are_refused_rather_than_cut(tmp_path: Path, reference: str) -> None:
    model = tmp_path / "model.xml"
    model.write_text(
        f'<mujoco><worldbody>\n<geom name="e{reference}gg" size="1"/></worldbody></mujoco>'
    )
    with pytest.raises(SceneError, match=r"model\.xml.* line 2, .*NUL"):
        check_files(model)
