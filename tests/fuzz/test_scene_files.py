"""Scene files, models and meshes of any content load, or raise our error."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from fuzzing import CHANGES, NUMBERS, VALUES, changed, fuzzed, outcome, places, put
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
from scene_files import write_scene

from ripple_sim.errors import SceneError
from ripple_sim.scene import Scene, SceneFile, load_scene, parse_scene
from ripple_sim.solver import Mesh, MeshError, RippleError, load_mesh

TABLE: dict[str, Any] = {
    "model": "scene.xml",
    "duration": 1.0,
    "camera": {"lookat": [0.0, 0.0, 0.0], "distance": 2.0},
    "ripple": [
        {"geom": "g", "material": {"speed": 1.0}, "still": [{"point": [0, 0, 1], "radius": 0.1}]}
    ],
    "drop": [{"body": "b", "time": 0.1}],
    "poke": [{"geom": "g", "time": 0.2, "point": [0, 0, 1], "impulse": 1.0, "radius": 0.1}],
}
TEXT = """model = "scene.xml"
duration = 1.0
[camera]
lookat = [0.0, 0.0, 0.0]
[[ripple]]
geom = "g"
look = "rubber"
[ripple.material]
speed = 0.6
"""
MODEL = (
    '<mujoco><option {}/><worldbody><body name="b"><freejoint/><geom name="g" '
    "{}/></body></worldbody>{}</mujoco>"
)


@fuzzed
@given(st.sampled_from(places(TABLE)[1:]), VALUES)
def test_a_table_with_any_value_anywhere(place: tuple, value: Any) -> None:
    assert isinstance(
        outcome(lambda: parse_scene(put(TABLE, place, value), "scene.toml")), SceneFile | SceneError
    )


@fuzzed
@given(CHANGES)
def test_a_file_with_any_bytes_anywhere(
    tmp_path_factory: pytest.TempPathFactory, changes: list
) -> None:
    folder = tmp_path_factory.getbasetemp() / "changed"
    folder.mkdir(exist_ok=True)
    path = write_scene(folder, MODEL.format("", 'type="sphere" size="1"', ""), "")
    path.write_bytes(changed(TEXT.encode(), changes))
    assert isinstance(outcome(lambda: load_scene(path)), Scene | RippleError)


OPTIONS = st.sampled_from(["timestep", "gravity", "integrator", "cone", "iterations", "impratio"])
SOLVERS = NUMBERS.map(str) | st.sampled_from(["RK4", "elliptic", "0 0 nan", "a"])
NAMES = st.sampled_from(
    ["type", "size", "mass", "density", "pos", "quat", "solref", "friction", "condim", "rgba"]
)
SHAPES = NUMBERS.map(str) | st.sampled_from(
    ["sphere", "box", "mesh", "0 0 0 0", "1 1 1", "nan 0 0", "plane", "sdf"]
)
KEYS = st.lists(NUMBERS, max_size=9).map(
    lambda row: f'<keyframe><key qpos="{" ".join(map(str, row))}"/></keyframe>'
)


def written(attributes: dict[str, str]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in attributes.items())


@fuzzed
@given(
    st.dictionaries(OPTIONS, SOLVERS, max_size=3),
    st.dictionaries(NAMES, SHAPES, max_size=4),
    KEYS | st.just(""),
)
def test_a_model_with_any_numbers(
    tmp_path_factory: pytest.TempPathFactory, option: dict, geom: dict, key: str
) -> None:
    folder: Path = tmp_path_factory.getbasetemp() / "model"
    folder.mkdir(exist_ok=True)
    model = MODEL.format(written(option), written({"size": "1", **geom}), key)
    path = write_scene(folder, model, 'model = "scene.xml"\n[[ripple]]\ngeom = "g"\n')
    found = outcome(lambda: load_scene(path))
    assert isinstance(found, Scene | RippleError)
    if isinstance(found, Scene):
        assert 0 < found.model.opt.timestep <= 1
    assert sorted(each.name for each in folder.iterdir()) == ["scene.toml", "scene.xml"]


def check_mesh(found: object) -> None:
    assert isinstance(found, Mesh) or (isinstance(found, MeshError) and "\n" not in str(found))
    if isinstance(found, Mesh):
        assert np.isfinite(found.V).all()
        assert len(found.F) > 0


@fuzzed
@given(st.sampled_from(["obj", "off", "ply", "stl", "glb"]), CHANGES, st.floats(0.2, 1))
def test_a_mesh_with_any_bytes_and_any_end(
    tmp_path_factory: Any, kind: str, changes: list, part: float
) -> None:
    path: Path = tmp_path_factory.getbasetemp() / f"fuzzed.{kind}"
    trimesh.creation.icosphere(subdivisions=1).export(path)
    content = changed(path.read_bytes(), changes)
    path.write_bytes(content[: int(part * len(content))])
    check_mesh(outcome(lambda: load_mesh(path)))


@fuzzed
@given(
    hnp.arrays(np.float64, st.tuples(st.integers(0, 8), st.just(3)), elements=st.floats(width=64)),
    hnp.arrays(np.int64, st.tuples(st.integers(0, 12), st.just(3)), elements=st.integers(-2, 9)),
)
def test_a_mesh_of_any_arrays(V: np.ndarray, F: np.ndarray) -> None:
    check_mesh(outcome(lambda: Mesh.from_arrays(V, F)))
