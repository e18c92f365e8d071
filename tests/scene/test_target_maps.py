"""The body inside a target, the shape at the beginning, and rims by region."""

import re
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim import RippleError, Simulation
from ripple_sim.errors import SceneError
from ripple_sim.scene import InsideEntry, evaluate, load_inside, load_scene
from ripple_sim.solver import WaveSolver
from ripple_sim.solver.operator import STIFF

# m; the core is shifted towards the body's x
RADIUS = 0.5
CORE = 0.3
SHIFT = 0.08
MODULUS = 500.0
DENSITY = 1000.0
VOXEL = 0.05

MJCF = f"""<mujoco><worldbody><body pos="3 0 0" euler="0 0 90">
<geom name="egg" type="sphere" size="{RADIUS}" pos="0 2 0" euler="0 90 0"/></body></worldbody>
</mujoco>"""
TOML = """model = "egg.xml"
[[ripple]]
geom = "egg"
resolution = 24
[ripple.material]
preset = {name = "layer", modulus = 500, density = 1000}
"""


def simulation_of(folder: Path, table: str) -> Simulation:
    (folder / "egg.toml").write_text(table)
    return Simulation(load_scene(folder / "egg.toml"), backend="cpu")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sphere that is turned in its body, and its core in millimetres and in voxels."""
    (tmp_path / "egg.xml").write_text(MJCF)
    core = trimesh.creation.icosphere(subdivisions=4, radius=1e3 * CORE)
    core.apply_translation([1e3 * SHIFT, 2e3, 0.0]).export(tmp_path / "core.stl")
    nodes = np.arange(-0.5, 0.5 + VOXEL / 2, VOXEL)
    x, y, z = np.meshgrid(nodes, nodes, nodes, indexing="ij")
    np.save(tmp_path / "core.npy", CORE - np.sqrt((x - SHIFT) ** 2 + y**2 + z**2))
    return tmp_path


@pytest.mark.parametrize(
    "inside",
    [
        "mesh = 'core.stl'\nscale = 1e-3",
        "volume = 'core.npy'\nthreshold = 0.0\nspacing = 0.05\norigin = [-0.5, 1.5, -0.5]",
    ],
    ids=["mesh", "volume"],
)
def test_thickness_of_the_layer_is_the_distance_to_the_body_inside(
    folder: Path, inside: str
) -> None:
    simulation = simulation_of(folder, TOML + f"[[ripple.inside]]\n{inside}\n")
    waves = simulation.ripples["egg"]
    # where the core is in the frame of the geom
    middle = simulation.ripples.to_geom("egg", [SHIFT, 2.0, 0.0])
    to = middle - waves.atlas.positions
    n = -waves.atlas.normals
    near = (to * n).sum(axis=-1)
    exact = near - np.sqrt(CORE**2 - (to**2).sum(axis=-1) + near**2)
    thickness = np.sqrt(STIFF * MODULUS / DENSITY / waves.material.stiffness)
    assert np.quantile(np.abs(thickness / exact - 1), 0.99) < 0.03
    assert exact.max() > 2 * exact.min()
    np.testing.assert_allclose(waves.material.density, 0.665 * DENSITY * thickness)


def test_thickness_limits_hold(folder: Path) -> None:
    toml = TOML.replace("resolution = 24", "resolution = 24\nthickness_limits = [0.15, 0.25]")
    simulation = simulation_of(
        folder, toml + "[[ripple.inside]]\nmesh = 'core.stl'\nscale = 1e-3\n"
    )
    density = np.asarray(simulation.ripples["egg"].material.density)
    assert [density.min(), density.max()] == pytest.approx(
        [0.665 * DENSITY * limit for limit in (0.15, 0.25)]
    )


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({}, "must name a mesh or a volume, got neither or both"),
        ({"mesh": "a.obj", "volume": "b.nii"}, "must name a mesh or a volume, got neither or both"),
        ({"volume": "b.nii"}, "needs a threshold"),
        ({"mesh": "a.obj", "threshold": 1.0}, "takes no threshold"),
        ({"mesh": "a.obj", "scale": 0.0}, "scale of a .* must be a number greater than 0, got 0.0"),
        (
            {"volume": "b.npy", "threshold": 1.0, "spacing": -1.0},
            "spacing of a .* must be .*, got -1.0",
        ),
    ],
)
def test_invalid_inside_entries_are_refused(entry: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        msgspec.convert(entry, InsideEntry).check()


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        (TOML.replace("preset", "#"), r"needs a layer; write preset = \{name = 'layer'"),
        (
            TOML.replace('"layer", modulus = 500', '"plate", modulus = 500'),
            "not the preset 'plate'",
        ),
        (TOML.replace("resolution = 24", "thickness_limits = [2, 1]"), "the least first"),
    ],
    ids=["without-preset", "no-layer", "limits"],
)
def test_a_scene_without_a_layer_is_refused(folder: Path, toml: str, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        simulation_of(folder, toml + "[[ripple.inside]]\nmesh = 'core.stl'\n")


def test_meshes_and_volumes_are_distinguished_by_their_endings(folder: Path) -> None:
    with pytest.raises(RippleError, match="is a volume, which needs a threshold"):
        load_inside(folder / "core.npy")
    with pytest.raises(RippleError, match="is a mesh, which takes no threshold"):
        load_inside(folder / "core.stl", 0.5)
    V, _ = load_inside(folder / "core.npy", 0.0, VOXEL, scale=2.0).surface()
    assert np.ptp(V[:, 0]) == pytest.approx(4 * CORE, rel=0.02)


X = np.linspace(-1, 1, 12).reshape(3, 4)
Y = np.linspace(0, 2, 12).reshape(3, 4)
NAMES = {"x": X, "y": Y, "z": 0 * X}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.02", 0.02 + 0 * X),
        ("x + 2*y - z", X + 2 * Y),
        (" -x**2 / 4 ", -(X**2) / 4),
        ("2**-x % 1", 2**-X % 1),
        ("0.02 * exp(-(x**2 + y**2) / 0.1**2)", 0.02 * np.exp(-(X**2 + Y**2) / 0.01)),
        (
            "sin(2*pi*x) * cos(y) + tan(z) + atan2(y, x)",
            np.sin(2 * np.pi * X) * np.cos(Y) + np.arctan2(Y, X),
        ),
        (
            "where(hypot(x, y) < 0.5, 1, minimum(x, y))",
            np.where(np.hypot(X, Y) < 0.5, 1, np.minimum(X, Y)),
        ),
        ("maximum(sqrt(abs(x)), log(1 + y))", np.maximum(np.sqrt(np.abs(X)), np.log(1 + Y))),
    ],
)
def test_expressions_have_the_values_of_numpy(text: str, value: np.ndarray) -> None:
    np.testing.assert_allclose(evaluate(text, NAMES), value, rtol=1e-14, atol=1e-16)


FORBIDDEN = """__import__('os').system('true') | x.__class__ | (lambda: 1)() | [x for x in y]
x if y else z
open('a') | 'a' * 9 | x[0] | exp(x, y) | exp(x=1) | sin | w
x < y < z | x and y | True | 1j | exp(*x) | x := 3 | x; y
9**9**9**9 | log(0) | 1/x + 1/(x-x)"""
TOO_LONG = ["(" * 300 + "x" + ")" * 300, "-" * 990 + "x", "x+" * 600 + "x"]


@pytest.mark.parametrize("text", [*re.split(r" \| |\n", FORBIDDEN), *TOO_LONG, "", "\0"])
def test_expressions_with_anything_else_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(SceneError, match="the expression") as error:
        evaluate(text, NAMES)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 600


BEGIN = """model = "egg.xml"
[[ripple]]
geom = "egg"
resolution = 8
material = {density = 10.0}
"""


def simulated(folder: Path, height: str) -> Simulation:
    (folder / "egg.xml").write_text(MJCF)
    return simulation_of(folder, BEGIN + f"[ripple.height]\n{height}\n")


def test_an_expression_is_of_the_position_in_the_frame_of_the_body(tmp_path: Path) -> None:
    simulation = simulated(tmp_path, "expression = '0.01 * (x - 2*z) * (y - 2)'")
    waves = simulation.ripples["egg"]
    # the geom's frame is turned about the body's y, and moved along it
    x, y, z = np.moveaxis(waves.atlas.positions, -1, 0)
    np.testing.assert_allclose(waves.height, 0.01 * (z + 2 * x) * y, atol=1e-6)


def test_a_reset_brings_the_shape_back_and_a_saved_field_begins_where_it_was(
    tmp_path: Path,
) -> None:
    simulation = simulated(tmp_path, "expression = '0.01 * x'")
    begun = simulation.ripples["egg"].height
    for _ in range(20):
        simulation.advance_frame()
    moved = simulation.ripples["egg"].height
    assert np.abs(moved - begun).max() > 1e-4
    np.save(tmp_path / "moved.npy", moved)
    simulation.reset()
    np.testing.assert_array_equal(simulation.ripples["egg"].height, begun)
    np.testing.assert_allclose(
        simulated(tmp_path, "field = 'moved.npy'").ripples["egg"].height, moved, atol=1e-8
    )


def test_an_image_is_taken_in_the_mesh_s_own_coordinates(tmp_path: Path) -> None:
    # a flat pyramid, whose texture coordinates are x and y
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.2]])
    lines = [f"v {x} {y} {z}\nvt {x} {y}" for x, y, z in V]
    lines += [f"f {a}/{a} {b}/{b} 5/5" for a, b in ((1, 2), (2, 3), (3, 4), (4, 1))]
    (tmp_path / "square.obj").write_text("\n".join(lines))
    Image.fromarray(np.repeat(np.arange(2, 256, 4, dtype=np.uint8)[None], 4, axis=0)).save(
        tmp_path / "ramp.png"
    )
    mesh = "<mesh name='m' file='square.obj' inertia='shell'/>"
    geom = "<geom name='egg' type='mesh' mesh='m'/>"
    model = f"<mujoco><asset>{mesh}</asset><worldbody>{geom}</worldbody></mujoco>"
    (tmp_path / "square.xml").write_text(model)
    heights = []
    for shape in ("map = 'ramp.png'\nlow = -0.01\nhigh = 0.01", "expression = '0.02 * x'"):
        table = BEGIN.replace("egg.xml", "square.xml") + f"[ripple.height]\n{shape}\n"
        heights.append(simulation_of(tmp_path, table).ripples["egg"].height)
    # the image repeats, so that its two ends meet within a pixel of the sides
    assert np.quantile(np.abs(heights[0] - heights[1]), 0.9) < 1e-4
    assert np.ptp(heights[1]) > 0.019


@pytest.mark.parametrize(
    ("height", "message"),
    [
        ("", "must have one of expression, map, field, got none"),
        ("expression = 'x'\nmap = 'a.png'", "must have one of .*, got expression and map"),
        ("expression = 'w'", "is unknown; an expression may have numbers, pi, x, y, z"),
        ("map = 'absent.png'", "which does not exist"),
        ("field = 'small.npy'", r"must hold numbers \(6, 8, 8\), got \(2, 2\)"),
        ("field = 'endless.npy'", "not finite"),
        ("field = 'egg.xml'", "cannot be read"),
        ("expression = '1/(x-x)'", "must be finite everywhere"),
    ],
    ids=["none", "two", "name", "absent", "small", "endless", "no-array", "infinite"],
)
def test_invalid_initial_shapes_are_refused(tmp_path: Path, height: str, message: str) -> None:
    np.save(tmp_path / "small.npy", np.zeros((2, 2)))
    np.save(tmp_path / "endless.npy", np.full((6, 8, 8), np.nan))
    with pytest.raises(RippleError, match=message):
        simulated(tmp_path, height)


def plate(folder: Path, rim: str) -> Simulation:
    """A steel plate of 1 x 0.4 m that lies along the y axis of its body, at rest."""
    x, y = (
        each.ravel() for each in np.meshgrid(np.linspace(-0.5, 0.5, 6), np.linspace(-0.2, 0.2, 4))
    )
    corner = (np.arange(3)[:, None] * 6 + np.arange(5)).ravel()
    F = np.concatenate([corner[:, None] + [0, 1, 7], corner[:, None] + [0, 7, 6]])
    trimesh.Trimesh(np.stack([x, y, 0 * x], axis=1), F, process=False).export(folder / "plate.obj")
    (folder / "plate.xml").write_text(
        """<mujoco><compiler balanceinertia="true"/><asset>
        <mesh name="plate" file="plate.obj" inertia="shell"/></asset>
        <worldbody><body>
        <geom name="plate" type="mesh" mesh="plate" pos="0 2 0" euler="0 0 90" contype="0"
        conaffinity="0"/></body></worldbody></mujoco>"""
    )
    table = f'[[ripple]]\ngeom = "plate"\nresolution = 12\nrim = {rim}\nmaterial.preset = "plate"\n'
    return simulation_of(folder, 'model = "plate.xml"\n' + table)


def test_rims_by_region_follow_their_conditions(tmp_path: Path) -> None:
    running = plate(tmp_path, '{clamped = "y < 1.51", supported = "where(y > 2.49, 1, y < 1.6)"}')
    waves = running.ripples["plate"]
    data = running.data
    mujoco.mj_forward(running.model, data)
    geom = running.model.geom("plate").id

    def conditions(points: np.ndarray) -> np.ndarray:
        """The conditions of the scene file at points in the frame of the geom."""
        rotation = data.geom_xmat[geom].reshape(3, 3)
        in_world = points @ rotation.T + data.geom_xpos[geom]
        y = in_world[:, 1]  # also in the frame of the body, which is at the origin
        return np.select([y < 1.51, (y > 2.49) | (y < 1.6)], ["clamped", "supported"], "free")

    same = WaveSolver(waves.atlas, waves.material, rim=conditions, backend="cpu")
    free = WaveSolver(waves.atlas, waves.material, rim="free", backend="cpu")
    for each in (waves, same, free):
        each.add_impulse((0.1, 0.05, 0.0), 1e-3, 0.1)
        each.step(0.08)
    np.testing.assert_array_equal(waves.height, same.height)
    assert np.abs(waves.height - free.height).max() > 0.1 * np.abs(free.height).max()


@pytest.mark.parametrize(
    ("rim", "message"),
    [
        ('"loose"', "rim must be one of free, supported, clamped, fixed, got 'loose'"),
        ('{fixed = "x < 0"}', "rim must be one of free, supported, clamped, got 'fixed'"),
        ('{clamped = "x < "}', "'x < ' is not valid"),
        (
            '{clamped = "y < 1"}',
            r"nowhere on its rims; they lie from \[-0.2, 1.5, 0.0\] to \[0.2, 2.5, 0.0\] m",
        ),
    ],
)
def test_invalid_rims_are_refused(tmp_path: Path, rim: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        plate(tmp_path, rim)


def test_a_closed_surface_has_no_rims_by_region(folder: Path) -> None:
    toml = TOML.replace(
        "resolution = 24", "resolution = 8\nlayout = 'patches'\nrim = {clamped = 'x < 0'}"
    )
    with pytest.raises(SceneError, match="it is closed; leave rim out"):
        simulation_of(folder, toml)
