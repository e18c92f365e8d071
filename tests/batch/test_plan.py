"""Plans: drawn values have the stated distributions, and reach the scene and the model."""

import msgspec
import numpy as np
import pytest
from small_batch import PLAN, small_plan

from ripple_sim.batch import Distribution, Variation, parse_key, read_plan
from ripple_sim.errors import SceneError
from ripple_sim.scenes.shapes import LIMBED_FILE


def test_keys_may_be_written_as_tables_or_with_quotes(tmp_path):
    plain = small_plan(tmp_path)
    quoted = small_plan(tmp_path, text=PLAN.replace("camera.azimuth", '"camera.azimuth"'))
    assert plain == quoted
    assert set(plain.vary) == {"camera.azimuth", "ripple[egg].material.speed"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("count = 5", "", "missing required field `count`"),
        ("count = 5", "count = 0", "count must be a whole number from 1 .*, got 0"),
        ("count = 5", "count = 5\nscene = 3", "unknown key 'scene'; keys are count, scenes"),
        ('"scene.toml"', '"duk"', "no scene 'duk'; shipped scenes are animal"),
        ('"scene.toml"', r'"\u0000"', "no scene"),
        ('"scene.toml"', f'"{"a" * 999}"', "no scene"),
        ('scenes = ["scene.toml"]', "", "names no scene"),
        ('scenes = ["scene.toml"]', 'meshes = {files = ["*.obj"]}', r"no mesh fits '\*.obj'"),
        ("uniform = [0, 360]", "uniform = 360", "camera.azimuth: Expected `array"),
        ("fps = 20", "fsp = 20", r"unknown key 'fsp' in \[store\]; keys are video, size, fps"),
        ("fps = 20", 'video = "avi"', "Invalid enum value 'avi'.*must be 'mp4', .* or 'none'"),
        ("fps = 20", "video = false", "got `bool`.*store.video`; it must be 'mp4', .* or 'none'"),
    ],
    ids=lambda value: value[:30] or "none",
)
def test_wrong_plans_are_refused_with_the_expected_values(tmp_path, old, new, message):
    assert old in PLAN
    with pytest.raises(SceneError, match=message):
        small_plan(tmp_path, text=PLAN.replace(old, new))


def draws(count: int = 2000, **given) -> np.ndarray:
    distribution = msgspec.convert(given, Distribution)
    distribution.check("key")
    rng = np.random.default_rng(0)
    return np.array([distribution.draw(rng) for _ in range(count)])


def test_uniform_numbers_fill_their_range_evenly():
    found = draws(uniform=[-2, 4])
    assert -2 <= found.min() < -1.9 < 3.9 < found.max() <= 4
    assert abs(found.mean() - 1) < 4 * np.sqrt(36 / 12 / len(found))


def test_log_uniform_numbers_are_as_often_below_as_above_the_geometric_mean():
    found = draws(log_uniform=[0.1, 1000])
    assert 0.1 <= found.min() <= found.max() <= 1000
    assert abs(np.log10(found).mean() - 1) < 4 * np.sqrt(16 / 12 / len(found))


def test_normal_numbers_have_their_mean_and_deviation_and_keep_to_limits():
    found = draws(normal=[5, 2])
    assert abs(found.mean() - 5) < 4 * 2 / np.sqrt(len(found))
    assert abs(found.std() - 2) < 0.15
    kept = draws(normal=[5, 2], limits=[5, 6])
    assert 5 <= kept.min() <= kept.max() <= 6
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
    assert found[:, 0].max() <= 1 < 10 <= found[:, 1].min()
    three = draws(uniform=[0, 1], length=3)
    assert np.abs(np.corrcoef(three.T) - np.eye(3)).max() < 0.1


def test_numbers_have_12_digits():
    assert all(number == float(f"{number:.12g}") for number in draws(50, log_uniform=[1e-3, 1e3]))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "must be drawn from one of .*, got nothing"),
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
def test_wrong_distributions_are_refused_with_the_expected_values(given, message):
    with pytest.raises(SceneError, match=message):
        msgspec.convert(given, Distribution).check("camera.azimuth")


def varied(tmp_path, vary="", model="", number=0):
    """The scene and the values of a plan with these keys."""
    text = f'scenes = ["scene.toml"]\ncount = 9\nseed = 5\n[vary]\n{vary}\n[model]\n{model}\n'
    return Variation(small_plan(tmp_path, text=text), number).load()


def test_keys_are_names_between_dots_with_a_choice_in_brackets():
    assert parse_key("ripple[a.b c].material.speed") == (
        ("ripple", "a.b c"),
        ("material", ""),
        ("speed", ""),
    )
    assert parse_key("camera.lookat[2]")[-1] == ("lookat", "2")


@pytest.mark.parametrize("key", ["", "a..b", "a.", "a[", "a[]", "1a", "a b"])
def test_invalid_keys_are_refused(key):
    with pytest.raises(SceneError, match="a key must be"):
        parse_key(key)


def test_values_of_a_scene_do_not_depend_on_other_variations(tmp_path):
    few = [Variation(small_plan(tmp_path), number) for number in range(4)]
    more = Variation(
        small_plan(
            tmp_path, text=PLAN.replace("[vary]", '[vary]\n"camera.fovy" = {uniform=[30,50]}')
        ),
        2,
    )
    values = [each.load()[1] for each in few]
    again = more.load()[1]
    assert again == {**values[2], "camera.fovy": again["camera.fovy"]}
    assert len({each.seed for each in few}) == 4
    assert len({each["camera.azimuth"] for each in values}) == 4


def test_values_reach_the_scene_and_the_model(tmp_path):
    scene, values = varied(
        tmp_path,
        vary='camera.lookat = {uniform = [-1, 1], length = 3}\n"ripple.material.speed" = {uniform '
        "= [2, 3], "
        'apply = "multiply"}\n"ripple[egg].look" = "clay"',
        model='"geom[stone].mass" = {uniform = [2, 3], apply = "multiply"}\n"geom[*].friction" = '
        "{uniform = [0, 1]}\n"
        '"body[stone].pos[2]" = {uniform = [1, 2], apply = "add"}\n"option.gravity[2]" = -1.5\n'
        '"light[0].diffuse" = {uniform = [0, 1], length = 3}\n"geom[grain].rgba" = [0, 1, 0]',
    )
    assert list(scene.camera.lookat) == values["camera.lookat"]
    assert scene.targets[0].material.speed == 0.3 * values["ripple[egg].material.speed"]
    assert scene.targets[0].look == "clay"
    model = scene.model
    sphere = 1000 * 4 / 3 * np.pi * 0.05**3
    assert model.body("stone").mass[0] == pytest.approx(sphere * values["geom[stone].mass"])
    friction = [values[f"geom[{name}].friction"] for name in ("egg", "stone", "grain")]
    assert [model.geom(name).friction[0] for name in ("egg", "stone", "grain")] == friction
    assert len(set(friction)) == 3
    assert model.body("stone").pos[2] == pytest.approx(0.28 + values["body[stone].pos[2]"])
    assert model.opt.gravity[2] == -1.5
    assert np.allclose(model.light_diffuse[0], values["light[key].diffuse"])
    assert list(model.geom("grain").rgba) == [0, 1, 0, 1]


def test_geoms_that_one_key_names_may_share_one_value(tmp_path):
    _, values = varied(tmp_path, model='"geom[*].friction" = {uniform = [0, 1], together = true}')
    assert len(values) == 3
    assert len(set(values.values())) == 1


@pytest.mark.parametrize(
    ("vary", "model", "message"),
    [
        ('"ripple[duck].look" = "clay"', "", r"no ripple\[duck\]; there is egg"),
        ('"camera.zoom" = 2', "", "unknown key 'zoom'"),
        ('"camera.distance" = {uniform = [1, 2], apply = "add"}', "", "is None in the scene"),
        ('"ripple.look" = 3', "", "Expected `str`"),
        ('"poke.time" = 3', "", r"write \[\[poke"),
        ("", '"geom[duck].size" = 1', r"no geom\[duck\]; there is egg, stone, grain"),
        ("", '"geom[stone].weight" = 1', "'weight', which does not exist; attributes are .*mass"),
        ("", '"ball.size" = 1', "no attribute of a model: name"),
        ("", '"geom[stone].size" = [1, 2, 3, 4]', "cannot set"),
        ("", '"geom[stone].size" = "big"', "cannot set 'big'"),
    ],
    ids=lambda value: value or "none",
)
def test_unknown_keys_are_refused_with_the_names_in_the_model(tmp_path, vary, model, message):
    with pytest.raises(SceneError, match=message):
        varied(tmp_path, vary, model)


def test_a_path_may_be_a_string():
    with pytest.raises(SceneError, match=r"plan 'lost\.toml' does not exist"):
        read_plan("lost.toml")


def test_a_drop_scene_takes_keys_of_scene_files_too(tmp_path):
    (tmp_path / "plan.toml").write_text(
        f'count = 4\n[meshes]\nfiles = ["{LIMBED_FILE}"]\nbodies = {{integers = [2, 4]}}\n'
        '[vary]\ncamera.azimuth = 7.0\n"ripple.material.speed" = {constant = 2.0, apply = '
        '"multiply"}\n'
        '[model]\n"geom[floor].rgba" = [0.5, 0.5, 0.5]'
    )
    plan = read_plan(tmp_path / "plan.toml")
    scene, values = Variation(plan, 1).load()
    assert 2 <= values["bodies"] == len(scene.events.drop) <= 4
    assert (scene.camera.azimuth, scene.camera.orbit) == (7, 5)
    assert scene.model.geom("floor").rgba[0] == 0.5
    assert scene.targets[0].material.density > 0


def test_randomisation_of_a_scene_file_depends_on_the_scene_number(tmp_path):
    plan = small_plan(tmp_path)
    scene_file = tmp_path / "scene.toml"
    scene_file.write_text(scene_file.read_text() + "[random]\nposition = 0.1\n")
    places = [Variation(plan, number).load()[0].model.body("stone").pos[0] for number in (0, 1, 0)]
    assert places[0] == places[2] != places[1]
