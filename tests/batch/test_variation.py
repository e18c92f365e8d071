import mujoco
import numpy as np
import pytest
from small_batch import PLAN, small_plan

from ripple_sim.batch.plan import Step, parse_key, read_plan
from ripple_sim.batch.variation import Variation, vary_model, vary_table
from ripple_sim.errors import SceneError
from ripple_sim.scenes.shapes import LIMBED_FILE


def varied(tmp_path, vary="", model="", number=0):
    """The scene and the values of a plan with these keys."""
    text = f'scenes = ["scene.toml"]\ncount = 9\nseed = 5\n[vary]\n{vary}\n[model]\n{model}\n'
    return Variation(small_plan(tmp_path, text=text), number).load()


def test_keys_are_names_between_dots_with_a_choice_in_brackets():
    assert parse_key("ripple[a.b c].material.speed") == (Step("ripple", "a.b c"), Step("material"), Step("speed"))
    assert parse_key("camera.lookat[2]")[-1].index == 2


@pytest.mark.parametrize("key", ["", "a..b", "a.", "a[", "a[]", "1a", "a b"])
def test_what_is_no_key_is_refused(key):
    with pytest.raises(SceneError, match="is not a key"):
        parse_key(key)


def test_a_number_has_the_same_values_whatever_else_varies(tmp_path):
    few = [Variation(small_plan(tmp_path), number) for number in range(4)]
    more = Variation(small_plan(tmp_path, text=PLAN.replace("[vary]", '[vary]\n"camera.fovy" = {uniform=[30,50]}')), 2)
    values = [each.load()[1] for each in few]
    again = more.load()[1]
    assert {key: again[key] for key in values[2]} == values[2]
    assert set(again) - set(values[2]) == {"camera.fovy"}
    assert len({each.seed for each in few}) == 4
    assert len({each["camera.azimuth"] for each in values}) == 4


def test_values_reach_the_scene_and_the_model(tmp_path):
    scene, values = varied(
        tmp_path,
        vary='camera.lookat = {uniform = [-1, 1], length = 3}\n"ripple.material.speed" = {uniform = [2, 3], '
        'apply = "multiply"}\n"ripple[egg].look" = "clay"',
        model='"geom[stone].mass" = {uniform = [2, 3], apply = "multiply"}\n"geom[*].friction" = {uniform = [0, 1]}\n'
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


def test_places_of_one_key_may_have_one_value(tmp_path):
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
        ('"poke.time" = 3', "", "Expected `array`"),
        ("", '"geom[duck].size" = 1', r"no geom\[duck\]; there is egg, stone, grain"),
        ("", '"geom[stone].weight" = 1', "'weight'; valid are .*mass"),
        ("", '"ball.size" = 1', "no attribute of a model; valid"),
        ("", '"geom[stone].size" = [1, 2, 3, 4]', "cannot set"),
        ("", '"geom[stone].size" = "big"', "cannot set 'big'"),
    ],
    ids=lambda value: value or "none",
)
def test_keys_that_fit_nothing_are_refused_with_what_there_is(tmp_path, vary, model, message):
    with pytest.raises(SceneError, match=message):
        varied(tmp_path, vary, model)


def test_a_drop_scene_takes_keys_of_scene_files_too(tmp_path):
    (tmp_path / "plan.toml").write_text(
        f'count = 4\n[meshes]\nfiles = ["{LIMBED_FILE}"]\nbodies = {{integers = [2, 4]}}\n'
        '[vary]\ncamera.azimuth = 7.0\n"ripple.material.speed" = {constant = 2.0, apply = "multiply"}\n'
        '[model]\n"geom[floor].rgba" = [0.5, 0.5, 0.5]'
    )
    plan = read_plan(tmp_path / "plan.toml")
    scene, values = Variation(plan, 1).load()
    assert 2 <= values["bodies"] <= 4
    assert len(scene.events.drop) == values["bodies"]
    assert scene.camera.azimuth == 7
    assert scene.camera.distance == 3.6
    assert scene.model.geom("floor").rgba[0] == 0.5
    assert scene.targets[0].material.density > 0


def test_the_random_part_of_a_scene_follows_the_number(tmp_path):
    plan = small_plan(tmp_path)
    scene_file = tmp_path / "scene.toml"
    scene_file.write_text(scene_file.read_text() + "[random]\nposition = 0.1\n")
    places = [Variation(plan, number).load()[0].model.body("stone").pos[0] for number in (0, 1, 0)]
    assert places[0] == places[2] != places[1]


def test_nothing_is_drawn_where_nothing_varies():
    spec = mujoco.MjSpec()
    assert vary_model(spec, {}, np.random.default_rng) == {}
    assert vary_table({}, {}, np.random.default_rng) == {}
