import os

import msgspec
import numpy as np
import pytest
from small_batch import PLAN, small_plan

from ripple_sim.batch.plan import Distribution, read_plan
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


def draws(count: int = 2000, **given) -> np.ndarray:
    distribution = msgspec.convert(given, Distribution)
    distribution.check("key")
    rng = np.random.default_rng(0)
    return np.array([distribution.draw(rng) for _ in range(count)])


def test_uniform_numbers_fill_their_range_evenly():
    found = draws(uniform=[-2, 4])
    assert -2 <= found.min() < -1.9
    assert 3.9 < found.max() <= 4
    assert abs(found.mean() - 1) < 4 * np.sqrt(36 / 12 / len(found))


def test_log_uniform_numbers_are_as_often_below_as_above_the_geometric_mean():
    found = draws(log_uniform=[0.1, 1000])
    assert found.min() >= 0.1
    assert found.max() <= 1000
    assert abs(np.log10(found).mean() - 1) < 4 * np.sqrt(16 / 12 / len(found))


def test_normal_numbers_have_their_mean_and_deviation_and_keep_to_limits():
    found = draws(normal=[5, 2])
    assert abs(found.mean() - 5) < 4 * 2 / np.sqrt(len(found))
    assert abs(found.std() - 2) < 0.15
    kept = draws(normal=[5, 2], limits=[5, 6])
    assert kept.min() >= 5
    assert kept.max() <= 6
    assert kept.std() > 0.2


def test_integers_include_both_ends():
    assert set(draws(integers=[3, 5])) == {3, 4, 5}


def test_choices_come_as_often_as_their_weights_say():
    found = draws(choice=["a", "b", "c"], weights=[1, 3, 0])
    assert set(found) == {"a", "b"}
    assert abs((found == "a").mean() - 0.25) < 0.04


def test_orientations_are_unit_quaternions_without_a_preferred_axis():
    found = draws(orientation=True)
    assert np.allclose(np.linalg.norm(found, axis=1), 1, atol=1e-11)
    assert np.allclose(found.T @ found / len(found), np.eye(4) / 4, atol=0.02)


def test_vectors_have_their_own_ranges_or_a_length():
    found = draws(uniform=[[0, 10], [1, 20]])
    assert found.shape == (2000, 2)
    assert found[:, 0].max() <= 1
    assert found[:, 1].min() >= 10
    three = draws(uniform=[0, 1], length=3)
    assert np.abs(np.corrcoef(three.T) - np.eye(3)).max() < 0.1


def test_numbers_have_12_digits():
    assert all(number == float(f"{number:.12g}") for number in draws(50, log_uniform=[1e-3, 1e3]))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "drawn from nothing"),
        ({"uniform": [0, 1], "choice": [1]}, "uniform and choice"),
        ({"uniform": [1, 0]}, "the lower one first"),
        ({"uniform": [0, float("nan")]}, "two finite numbers"),
        ({"uniform": [[0, 0], [1, 1, 1]]}, "same length"),
        ({"log_uniform": [0, 1]}, "above 0"),
        ({"normal": [0, -1]}, "standard deviation of 0 or more"),
        ({"choice": []}, "at least one"),
        ({"choice": [1, 2], "weights": [1]}, "2 weights"),
        ({"uniform": [0, 1], "weights": [1]}, "weights, which uniform does not take"),
        ({"uniform": [0, 1], "length": 0}, "length 0"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_wrong_distributions_are_refused_with_what_is_valid(given, message):
    with pytest.raises(SceneError, match=message):
        msgspec.convert(given, Distribution).check("camera.azimuth")
