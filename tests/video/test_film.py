"""Overlays on real frames: colours, contacts, two runs side by side.

Needs an OpenGL context; software will do.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bouncing_stone import MJCF, TOML
from mujoco_models import posed
from scene_files import write_scene
from sphere_height_maps import cube_charts
from unfinished_videos import interrupting_at

from ripple_sim import Scene, Simulation, load_scene, overlay, render_video
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.errors import VideoError
from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import shapes as meshes
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.layouts.cube import cube_topology, texel_directions
from ripple_sim.solver.texels import with_filled_halo
from ripple_sim.video import Film, Progress, VideoOptions

N = 24
RATE = 30
FRAMES = 8
EVERYTHING = ["height", "contacts", "grid", "time", "energy"]

pytestmark = pytest.mark.usefixtures("opengl")


@pytest.fixture
def make_scene(tmp_path: Path) -> Callable[..., Scene]:
    return lambda toml=TOML: load_scene(write_scene(tmp_path, MJCF, toml))


def film_of(
    scene: Scene, words: list[str], size: tuple[int, int], baseline: str | None = None
) -> Film:
    operators = overlay.compared_operators(baseline)
    simulations = [
        Simulation(scene, fps=RATE, backend="cpu", operator=operator) for operator in operators
    ]
    return Film(
        simulations, VideoOptions(size=size, fps=RATE, overlay=words, compare=baseline), FRAMES
    )


def last_frame(film: Film) -> np.ndarray:
    return next(film.render_all(list(film.shots(alive=FRAMES))[-1:]))


def ball_with_field(field: np.ndarray, limit: float) -> np.ndarray:
    model, data = posed(
        '<mujoco><worldbody><geom name="target" type="sphere" size="1"/></worldbody></mujoco>'
    )
    ball = meshes.ball(16)
    surface = Surface(
        ball.shell,
        ball.faces,
        cube_charts(ball.shell),
        "metal",
        heatmap_colors=overlay.color_table(),
    )
    renderer = Renderer(shared_context(), model, {0: surface}, size=(200, 200))
    renderer.set_heatmap(0, with_filled_halo(cube_topology(field.shape[1]), field), limit)
    return renderer.render(data, {}, Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 40.0))


@pytest.mark.parametrize("value", [-0.013, -0.004, 0.0, 0.002, 0.009, 0.5])
def test_surface_has_the_color_of_its_height(value: float) -> None:
    picture = ball_with_field(np.full((6, N, N), value, np.float32), 0.01)
    inside = picture[80:120, 80:120].astype(float)
    expected = overlay.colors(value, 0.01).astype(float)
    shade = inside.max(axis=-1) / expected.max()
    assert shade.min() > 0.4
    # where the light falls the colour is the bar's own
    assert shade.max() == pytest.approx(1, abs=0.02)
    # and only darker elsewhere
    np.testing.assert_allclose(inside, shade[..., None] * expected, atol=2.5)


def test_field_is_where_it_belongs_and_seamless() -> None:
    atlas_z = np.linspace(-1, 1, 200)[::-1]
    picture = ball_with_field(texel_directions(N)[..., 2].astype(np.float32), 1.0).astype(int)
    red = picture[..., 0] - picture[..., 2]
    radius = np.tan(np.arcsin(1 / 4.0)) / np.tan(np.radians(20.0))
    column = red[:, 100][np.abs(atlas_z) < 0.9 * radius]
    assert column[0] > 60 > -60 > column[-1]
    # from red at the top to blue at the bottom without a step back
    assert (np.diff(column) < 12).all()


def test_mark_lies_at_the_projected_contact(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    simulation = Simulation(scene, fps=RATE, backend="cpu")
    marks = overlay.ContactMarks(simulation, 1 / RATE)
    gathered: list[overlay.Mark] = []
    while not gathered:
        simulation.advance_frame()
        gathered = marks.follow()
    hit = simulation.impulses[-1]
    waves = simulation.ripples["egg"]
    height = abs(float(waves.height[hit.texel]))
    assert np.linalg.norm(gathered[0].point - hit.point) < height + 1e-6
    assert gathered[0].axis[2] > 0.9  # on top of the egg
    assert gathered[0].impulse == pytest.approx(sum(each.impulse for each in simulation.impulses))

    camera = Camera((0.0, 0.0, 0.0), 1.6, 90.0, -30.0)
    width = 320
    height_px = 180
    frame = np.full((height_px, width, 3), 255, np.uint8)
    projection = overlay.Projection(camera.pose(), width, height_px)
    layout = overlay.Layout(width, height_px)
    overlay.draw_marks(
        frame, overlay.place_marks(gathered, 1e9, layout, projection, *posed("<mujoco/>")), layout
    )  # nothing but its dot
    dark = (255.0 - frame.min(axis=2)).round()
    rows, columns = np.indices(dark.shape)
    centre = np.array([(dark * (columns + 0.5)).sum(), (dark * (rows + 0.5)).sum()]) / dark.sum()
    expected = projection.pixels(gathered[0].point[None])[0]
    np.testing.assert_allclose(centre, expected, atol=0.1)


@pytest.mark.parametrize("baseline", ["paper", "uncorrected"])
def test_halves_of_a_comparison_are_the_separate_runs(
    make_scene: Callable[..., Scene], baseline: str
) -> None:
    scene = make_scene()
    film = film_of(scene, [], (320, 120), baseline)
    frame = last_frame(film)
    halves = []
    for operator in ("fem", baseline):
        simulation = Simulation(scene, fps=RATE, backend="cpu", operator=operator)
        source = FrameSource(simulation, width=160, height=120)
        halves.append(source.render(list(snapshots(simulation, FRAMES))[-1]))
    # below the titles, and without the seam
    np.testing.assert_array_equal(frame[30:, :158], halves[0][30:, :158])
    np.testing.assert_array_equal(frame[30:, 162:], halves[1][30:, 2:])
    assert (frame[30:, 2:158] != frame[30:, 162:318]).any()
    assert (frame[50, 159:161] == 255).all()


def test_runs_share_their_scales(make_scene: Callable[..., Scene]) -> None:
    film = film_of(make_scene(), ["height", "contacts", "energy"], (64, 48), "uncorrected")
    notes = [shot.notes for shot in film.shots()][-1]
    largest = max(float(values.max()) for _, values in notes.energies)
    assert notes.energy_scale[1] >= largest > 0
    assert len(notes.heatmaps) == len(notes.marks) == len(notes.energies) == 2
    times, values = notes.energies[0]
    assert times[-1] == pytest.approx(notes.time)
    assert values[-1] == pytest.approx(film.simulations[0].ripples["egg"].energy())


def test_overlays_on_a_transparent_background(make_scene: Callable[..., Scene]) -> None:
    frames = []
    for words in ([], EVERYTHING):
        simulation = Simulation(make_scene(), fps=RATE, backend="cpu")
        film = Film(
            [simulation],
            VideoOptions(size=(192, 108), fps=RATE, overlay=words, transparent=True),
            FRAMES,
        )
        frames.append(last_frame(film))
    plain, drawn = frames
    assert drawn.shape == (108, 192, 4)
    assert plain[8, 12, 3] < 100  # a corner of the background
    assert drawn[8, 12, 3] > 200  # where the clock stands
    assert (drawn[..., 3] >= plain[..., 3]).all()


def test_resumed_video_is_the_unbroken_one(
    make_scene: Callable[..., Scene], tmp_path: Path
) -> None:
    """Two runs under overlays, each frame a mean over the shutter and the lens."""
    blur = {
        "shutter": 180.0,
        "aperture": 0.05,
        "focus": "stone",
        "exposures": 2,
        "slow_motion": 2.0,
    }
    extra = {"compare": "paper", "transparent": True, "supersample": 2, "overlay": EVERYTHING}

    def render(name: str, progress: Progress | None = None, **options: Any) -> list[bytes]:
        options = {"size": (192, 108), "fps": 20, "duration": 0.15, **blur, **extra, **options}
        render_video(make_scene(), tmp_path / name, VideoOptions(**options), progress=progress)
        return [path.read_bytes() for path in sorted((tmp_path / name).iterdir())]

    with pytest.raises(KeyboardInterrupt):
        render("broken", progress=interrupting_at(4))
    with pytest.raises(VideoError, match=r"the camera's shutter was 180\.0 and now is 90\.0"):
        render("broken", resume=True, shutter=90.0)
    whole = render("whole")
    assert len(set(whole)) == len(whole) == 6
    assert render("broken", resume=True) == whole


def test_scene_file_names_overlays_and_a_video_shows_them(
    make_scene: Callable[..., Scene], tmp_path: Path
) -> None:
    scene = make_scene('overlay = ["height=0.01", "time"]\n' + TOML)
    assert scene.overlay == ("height=0.01", "time")
    pictures = {}
    for name, words in (("own", None), ("same", ["height=0.01", "time"]), ("none", [])):
        render_video(
            scene, tmp_path / name, VideoOptions(size=(96, 54), fps=10, duration=0.3, overlay=words)
        )
        pictures[name] = sorted(path.read_bytes() for path in (tmp_path / name).iterdir())
    assert pictures["own"] == pictures["same"] != pictures["none"]
