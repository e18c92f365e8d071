"""Runs written as USD and read again by usd-core, and by Blender in a process of its own."""

import math
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco_models import forwarded
from programs import PROGRAMS

from ripple_sim import Exporter, ExportOptions, Material, RippleError, Ripples, export_scene
from ripple_sim.cycles import python_with_bpy
from ripple_sim.export import MovingMesh
from ripple_sim.render import find_viewpoint, view_matrix
from ripple_sim.scene import CameraEntry, Scene

pxr = pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdValidation  # noqa: E402

FRAMES = 6
FPS = 500
SURFACE = "/World/bodies/nest/egg"


@pytest.fixture(scope="module", params=[".usdc", ".usda", ".usdz"])
def run(
    request: pytest.FixtureRequest, ripples: Ripples, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """A stage, and what was at each frame: points, velocities, and the stone's pose."""
    path = tmp_path_factory.mktemp("run") / f"run{request.param}"
    model = ripples.model
    data = forwarded(ripples.model)
    ripples.reset()
    mesh = MovingMesh(ripples["egg"].atlas)
    seen = []
    camera = CameraEntry(name="side", aperture=0.02, focus=1.5, shutter=180.0)
    with Exporter(model, ripples, path, fps=FPS, camera=camera) as exporter:
        for _ in range(FRAMES):
            ripples.mj_step(data, nstep=2)
            exporter.write(data)
            shape = mesh.shape(ripples["egg"].height, ripples["egg"].velocity)
            seen.append(
                (
                    shape.points,
                    shape.velocities,
                    data.xpos.copy(),
                    data.xmat.copy(),
                    data.geom_xpos.copy(),
                )
            )
    return Usd.Stage.Open(str(path)), seen


def at(stage: Any, path: str, frame: int) -> np.ndarray:
    """The matrix of a prim into the world, for column vectors."""
    prim = UsdGeom.Xformable(stage.GetPrimAtPath(path))
    return np.array(prim.ComputeLocalToWorldTransform(Usd.TimeCode(frame))).T


def test_stage_is_valid_in_metres_with_z_up_and_a_time_code_a_frame(run: Any) -> None:
    stage, _ = run
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    assert [error.GetErrorAsString() for error in errors] == []
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1.0, "Z")
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, FRAMES - 1)
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == FPS
    assert stage.GetDefaultPrim().GetPath() == "/World"
    path = stage.GetRootLayer().realPath
    packed = zipfile.ZipFile(path).infolist() if path.endswith(".usdz") else []
    # the same bytes whenever it is written
    assert all(file.date_time[0] == 1980 for file in packed)


def test_stored_points_and_velocities_match_the_solver_to_a_millionth(run: Any) -> None:
    stage, seen = run
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SURFACE))
    assert max(np.abs(points - seen[0][0]).max() for points, *_ in seen) > 1e-5  # it moves
    for frame, (points, velocities, *_) in enumerate(seen):
        assert np.abs(np.array(mesh.GetPointsAttr().Get(frame)) - points).max() < 1e-6 * 0.6
        assert np.abs(np.array(mesh.GetVelocitiesAttr().Get(frame)) - velocities).max() < 1e-6
        assert len(mesh.GetNormalsAttr().Get(frame)) == len(points)
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    indices = mesh.GetFaceVertexIndicesAttr().Get()
    counts = mesh.GetFaceVertexCountsAttr().Get()
    assert UsdGeom.Mesh.ValidateTopology(indices, counts, len(seen[0][0]))[0]


def test_bodies_and_surfaces_have_mujocos_poses(run: Any) -> None:
    stage, seen = run
    stone = 2
    egg = 1
    for frame, (_, _, xpos, xmat, geom_xpos) in enumerate(seen):
        world = at(stage, "/World/bodies/stone", frame)
        assert np.abs(world[:3, 3] - xpos[stone]).max() < 1e-9
        assert np.abs(world[:3, :3] - xmat[stone].reshape(3, 3)).max() < 1e-9
        assert np.abs(at(stage, SURFACE, frame)[:3, 3] - geom_xpos[egg]).max() < 1e-9
    assert (
        stage.GetPrimAtPath("/World/bodies/nest")
        .GetAttribute("xformOp:translate")
        .GetNumTimeSamples()
        == 1
    )


def test_camera_has_the_angle_of_view_the_lens_and_the_shutter(run: Any) -> None:
    stage, _ = run
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/camera")).GetCamera(2)
    assert camera.GetFieldOfView(camera.FOVVertical) == pytest.approx(40, abs=1e-4)
    assert camera.aspectRatio == pytest.approx(1280 / 720)
    assert camera.focusDistance == 1.5
    # focal length over f-number is the diameter of the lens, in tenths of a metre
    assert camera.focalLength / camera.fStop == pytest.approx(0.2)
    assert UsdGeom.Camera(stage.GetPrimAtPath("/World/camera")).GetShutterCloseAttr().Get() == 0.5
    forward = -np.array(camera.transform).T[:3, 2]
    assert np.abs(forward - np.array([0, 1, -0.2]) / math.hypot(1, 0.2)).max() < 1e-9


CAMERAS = """<mujoco><worldbody><geom name="ball" size=".3"/>
  <camera name="orthographic" pos="0 -2 .3" xyaxes="1 0 0 0 .2 1" projection="orthographic"
    fovy="1.5"/>
  <camera name="off centre" pos="0 -2 .3" xyaxes="1 0 0 0 .2 1" resolution="320 240"
    sensorsize="8e-3 6e-3"
    focal="5e-3 7e-3" principal="1e-3 .5e-3"/></worldbody></mujoco>"""


@pytest.mark.parametrize("name", ["orthographic", "off centre"])
def test_cameras_of_all_projections_see_what_ours_see(name: str, tmp_path: Path) -> None:
    model = mujoco.MjModel.from_xml_string(CAMERAS)
    data = forwarded(model)
    ripples = Ripples(
        model, {"ball": Material(speed=1.0, density=1.0)}, resolution=8, backend="cpu"
    )
    with Exporter(model, ripples, tmp_path / "run.usda", camera=name, size=(320, 240)) as exporter:
        exporter.write(data)
    stage = Usd.Stage.Open(str(tmp_path / "run.usda"))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/World/camera")).GetCamera(0).frustum
    pose = find_viewpoint(model, data, name).pose()
    theirs = np.array(frustum.ComputeProjectionMatrix()).T @ np.array(frustum.ComputeViewMatrix()).T
    np.testing.assert_allclose(theirs, pose.projection(320 / 240) @ view_matrix(pose), atol=1e-4)


def test_lamps_light_the_middle_as_strongly_as_ours(run: Any) -> None:
    stage, _ = run
    lamps = [UsdLux.LightAPI(prim) for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)]
    gloss = {lamp.GetPrim().GetTypeName(): lamp.GetSpecularAttr().Get() for lamp in lamps}
    weak = pytest.approx(0.137, abs=1e-3)  # sRGB 0.1 over 0.3, as light
    # headlight, ambient light, spot lamp
    assert gloss == {"DistantLight": 1, "DomeLight": 1, "SphereLight": weak}
    (far,) = (prim for prim in stage.Traverse() if prim.GetTypeName() == "DistantLight")
    degrees = np.degrees(far.GetAttribute("userProperties:angle").Get())  # which Blender doubles
    assert degrees == pytest.approx(UsdLux.DistantLight(far).GetAngleAttr().Get())


def test_looks_and_textures_are_bound(run: Any) -> None:
    stage, _ = run

    def surface(path: str) -> Any:
        material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()
        return material.ComputeSurfaceSource()[0]

    assert surface(SURFACE).GetInput("roughness").Get() == pytest.approx(0.36)  # rubber
    assert tuple(surface("/World/bodies/stone/stone").GetInput("diffuseColor").Get()) == (1, 0, 0)
    image = (
        surface("/World/bodies/world/floor")
        .GetInput("diffuseColor")
        .GetConnectedSources()[0][0]
        .source
    )
    file = UsdShade.Shader(image.GetPrim()).GetInput("file").Get()
    assert file.resolvedPath
    st = (
        UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/World/bodies/world/floor"))
        .GetPrimvar("st")
        .ComputeFlattened()
    )
    # the image repeats as often as the MJCF says
    assert np.ptp(np.array(st), axis=0) == pytest.approx([4, 4])


def test_velocities_of_a_scene_are_the_rates_of_its_points(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "scene.usdc"
    options = ExportOptions(fps=250, slow_motion=4.0, duration=0.04, tessellation="own")
    summary = export_scene(scene, path, options)
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SURFACE))
    points = np.array(
        [mesh.GetPointsAttr().Get(frame) for frame in range(summary.frames)], dtype=float
    )
    velocities = np.array([mesh.GetVelocitiesAttr().Get(frame) for frame in range(summary.frames)])
    assert summary.frames == 40
    differences = (points[2:] - points[:-2]) * 250 / 2  # a second of the file
    peak = np.linalg.norm(differences, axis=2).max()
    assert peak > 1e-4
    quiet = np.linalg.norm(differences - velocities[1:-1], axis=2)[-10:]  # after the stone has left
    assert quiet.max() < 0.01 * peak


SEEN = 7
SURFACES = ("egg", "jelly")


@pytest.mark.parametrize("chunk", [None, 3])
def test_blender_reads_the_stored_vertices_at_every_frame(
    soft_model: mujoco.MjModel, tmp_path: Path, chunk: int | None
) -> None:
    """Also of a soft body, and of a run in chunks."""
    try:
        python = python_with_bpy()
    except RippleError as error:
        pytest.skip(str(error))
    data = mujoco.MjData(soft_model)
    waves = Material(speed=0.3, density=1500.0)
    ripples = Ripples(soft_model, dict.fromkeys(SURFACES, waves), resolution=8, backend="cpu")
    x, y, _ = np.moveaxis(ripples["egg"].atlas.normals, -1, 0)
    ripples["egg"].height = 0.02 * np.sin(5 * x) * np.cos(4 * y)
    seen: dict[str, list[np.ndarray]] = {name: [] for name in SURFACES}
    with Exporter(soft_model, ripples, tmp_path / "run.usdc", chunk=chunk) as exporter:
        for _ in range(SEEN):
            ripples.mj_step(data, nstep=8)
            exporter.write(data)
            rotation = data.geom("egg").xmat.reshape(3, 3)
            position = data.geom("egg").xpos
            for name in SURFACES:
                mesh = exporter._source.mesh(name)
                points = mesh.shape(
                    ripples[name].height, ripples[name].velocity, ripples.vertices(name, data)
                ).points
                seen[name].append(points @ rotation.T + position if name == "egg" else points)
    reader = PROGRAMS / "read_usd_in_blender.py"
    arguments = [tmp_path / "run.usdc", tmp_path / "found.npz", SEEN, *SURFACES]
    subprocess.run([python, reader, *map(str, arguments)], check=True, capture_output=True)
    with np.load(tmp_path / "found.npz") as found:
        assert found["range"].tolist() == [0, SEEN - 1]
        for name in SURFACES:
            size = np.ptp(seen[name][0], axis=0).max()
            assert np.abs(found[name] - np.array(seen[name])).max() < 1e-6 * size
            assert np.abs(np.ptp(seen[name], axis=0)).max() > 1e-3 * size  # it moves
