import os

import pytest
from small_batch import PLAN, small_plan

from ripple_sim.batch.plan import read_plan
from ripple_sim.errors import SceneError


def test_keys_may_be_written_as_tables_or_with_quotes(tmp_path):
    plain = small_plan(tmp_path)
    quoted = small_plan(tmp_path, text=PLAN.replace("camera.azimuth", '"camera.azimuth"'))
    assert plain == quoted
    assert set(plain.vary) == {"camera.azimuth", "ripple[egg].material.speed"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("count = 5", "", "missing required field `count`"),
        ("count = 5", "count = 0", "count is 0; valid is a whole number from 1"),
        ("count = 5", "count = 5\nscene = 3", "unknown key 'scene'; valid are count, scenes"),
        ("count = 5", "count = = 5", "not valid TOML"),
        ('"scene.toml"', '"duk"', "no scene 'duk'; shipped scenes are animal"),
        ('scenes = ["scene.toml"]', "", "names no scene"),
        ('scenes = ["scene.toml"]', 'meshes = {files = ["*.obj"]}', r"no mesh fits '\*.obj'"),
        ("uniform = [0, 360]", "uniform = 360", "camera.azimuth: Expected `array"),
        ("fps = 20", "fsp = 20", "unknown field `fsp`"),
        ("fps = 20", 'video = "avi"', "Invalid enum value 'avi'"),
    ],
    ids=lambda value: value or "none",
)
def test_wrong_plans_are_refused_with_what_is_valid(tmp_path, old, new, message):
    assert old in PLAN
    with pytest.raises(SceneError, match=message):
        small_plan(tmp_path, text=PLAN.replace(old, new))


def test_a_plan_that_is_a_fifo_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "plan.toml")
    with pytest.raises(SceneError, match=r"plan\.toml' is not a regular file"):
        read_plan(tmp_path / "plan.toml")
