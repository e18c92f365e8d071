"""From a scene to a video: frames, determinism, nothing left behind."""

from pathlib import Path

import av
import numpy as np
import pytest
from bouncing_stone import MJCF, TOML
from scene_files import write_scene

from ripple_sim import Scene, Simulation, VideoOptions, load_scene, render_video
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.errors import SceneError, SimulationError
from ripple_sim.solver.gl import shared_context

pytestmark = pytest.mark.usefixtures("opengl")


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load_scene(write_scene(tmp_path, MJCF, TOML))


@pytest.mark.parametrize("backend", ["cpu", "gl"])
def test_same_scene_twice_gives_the_same_fields_and_frames(scene: Scene, backend: str) -> None:
    def result() -> tuple[bytes, bytes]:
        simulation = Simulation(scene, fps=30, backend=backend)
        frames = FrameSource(simulation, width=160, height=90)
        *_, last = snapshots(simulation, 11)
        return last.heights["egg"].tobytes(), frames.render(last).tobytes()

    first = result()
    second = result()
    assert first == second
    assert np.frombuffer(first[0], np.float32).any()


def test_video_has_the_frames_that_were_asked_for(scene: Scene, tmp_path: Path) -> None:
    calls = []
    options = VideoOptions(size=(160, 90), fps=20)
    progress = lambda *frames: calls.append(frames)  # noqa: E731
    summary = render_video(scene, tmp_path / "out" / "a.mp4", options, progress=progress)
    assert summary.frames == 10
    assert calls == [(i + 1, 10) for i in range(10)]
    with av.open(summary.output) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height, float(stream.average_rate)) == (160, 90, 20)
        assert sum(1 for _ in container.decode(video=0)) == 10
    assert summary.backend in ("cpu", "gl")
    assert summary.renderer == shared_context().renderer
    assert summary.substeps_per_frame > 0
    assert (
        min(
            summary.physics_seconds,
            summary.wave_seconds,
            summary.render_seconds,
            summary.encode_seconds,
        )
        > 0
    )


def test_slow_motion_shows_the_same_simulation_more_often(scene: Scene, tmp_path: Path) -> None:
    summary = render_video(
        scene, tmp_path / "slow.mp4", VideoOptions(size=(64, 48), fps=10, slow_motion=2.5)
    )
    assert summary.frames == 12  # half a second of the scene, 25 frames a second of it
    with av.open(summary.output) as container:
        assert float(container.streams.video[0].average_rate) == 10
    heights = [
        state.data.qpos[2] for state in snapshots(Simulation(scene, fps=10 * 2.5, backend="cpu"), 3)
    ]
    # it falls freely: at frame k, k / 25 s have gone by
    np.testing.assert_allclose(heights[0] - heights, 9.81 / 2 * (np.arange(3) / 25) ** 2, rtol=0.06)
    with pytest.raises(SceneError, match=r"slow motion must be .* up to 1000, got 2000"):
        render_video(scene, tmp_path / "none.mp4", VideoOptions(slow_motion=2000))


def test_supersampled_frames_have_softer_edges_of_the_same_brightness(scene: Scene) -> None:
    simulation = Simulation(scene, fps=30, backend="cpu")
    (state,) = snapshots(simulation, 1)
    sources = (
        FrameSource(simulation, width=96, height=54, supersample=factor) for factor in (1, 3)
    )
    plain, fine = (source.render(state).astype(float) for source in sources)
    assert fine.shape == plain.shape
    assert 0 < np.abs(fine - plain).mean() < 3
    assert np.abs(fine.mean() - plain.mean()) < 1


def test_unstable_physics_is_reported_and_no_file_is_left(tmp_path: Path) -> None:
    wild = MJCF.replace(
        '<option timestep="0.002"/>', '<option timestep="0.01" gravity="0 0 -1e9"/>'
    )
    scene = load_scene(write_scene(tmp_path, wild, TOML))
    with pytest.raises(SimulationError, match="became unstable at"):
        render_video(scene, tmp_path / "x.mp4", VideoOptions(size=(64, 48), fps=20))
    assert not (tmp_path / "x.mp4").exists()
    assert len(list(tmp_path.iterdir())) == 2


def test_energy_of_bodies_and_waves_is_that_of_the_ripples(scene: Scene) -> None:
    simulation = Simulation(scene, fps=30, backend="cpu")
    begun = simulation.energy
    for _ in range(12):
        simulation.advance_frame()
    assert begun.waves == 0
    assert simulation.energy == simulation.ripples.energy(simulation.data)
    assert simulation.energy.waves > 0
    assert simulation.energy.bodies < begun.bodies
