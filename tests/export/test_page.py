"""Pages that play a run: their coding, and what a browser shows."""

import html
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco_models import forwarded
from pages import SIZE, image_of, opened, pixels
from scipy import ndimage

from ripple_sim import (
    Exporter,
    ExportOptions,
    Material,
    RippleRenderer,
    Ripples,
    Scene,
    Simulation,
    export_scene,
)
from ripple_sim.capture import FrameSource, snapshots
from ripple_sim.encode import made_here
from ripple_sim.export import MovingMesh
from ripple_sim.render.surfaces import memory_order

FPS = 100
FRAMES = 20
SEEN = 18


@pytest.fixture(scope="module")
def page(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "run.html"
    export_scene(scene, path, ExportOptions(fps=FPS, duration=FRAMES / FPS, size=SIZE))
    return path


@pytest.fixture(scope="module")
def film(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run as a page that replays heights."""
    path = tmp_path_factory.mktemp("film") / "run.html"
    options = ExportOptions(fps=FPS, duration=FRAMES / FPS, size=SIZE, replay=True)
    export_scene(scene, path, options)
    return path


@pytest.fixture(scope="module")
def ours(scene: Scene, opengl: None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A frame of our renderer, its pixels of the egg, and the heights of the page's vertices."""
    simulation = Simulation(scene, fps=FPS)
    source = FrameSource(simulation, width=SIZE[0], height=SIZE[1])
    *_, snapshot = snapshots(simulation, SEEN + 1)
    frame = source.render(snapshot)
    assert frame is not None
    egg = source.sighting(snapshot).image.geom == simulation.ripples.geom_ids["egg"]
    waves = simulation.ripples["egg"]
    mesh = MovingMesh(waves.atlas, triangles=16_000)
    heights = mesh.shape(waves.height, waves.velocity).height
    return frame, egg, heights[memory_order(mesh.F, mesh.rest)[1]]


@pytest.fixture(scope="module")
def shown(browser: Any, page: Path) -> Iterator[Any]:
    """The page in a browser, paused."""
    with opened(browser, page) as tab:
        tab.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")
        yield tab


def test_triangles_and_vertices_lie_close_to_their_neighbours_in_order() -> None:
    rng = np.random.default_rng(2)
    x, y = np.divmod(np.arange(900), 30)
    points = np.stack([x, y, 0 * x], axis=1)[shuffled := rng.permutation(900)].astype(float)
    corner = np.arange(900).reshape(30, 30)[:-1, :-1].ravel()
    F = np.argsort(shuffled)[
        np.concatenate([corner[:, None] + [0, 30, 31], corner[:, None] + [0, 31, 1]])
    ]
    F = F[rng.permutation(len(F))]
    renumbered, vertices, triangles = memory_order(F, points)
    assert np.array_equal(points[vertices][renumbered], points[F[triangles]])
    assert np.array_equal(np.sort(vertices), np.arange(900))
    again = [len(set(block.ravel())) for block in np.split(renumbered[:1664], 52)]
    assert np.mean(again) < 32  # different vertices of 32 triangles in a row; at random 93


def test_a_page_is_one_file_that_asks_for_nothing_else(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'https?://|src="|href="', text)
    assert [each.name for each in page.parent.iterdir()] == ["run.html"]
    assert made_here(page)


def test_a_pages_lamps_have_highlights_as_weak_as_ours(page: Path) -> None:
    (meta,) = re.findall(
        r'<script type="application/json" id="meta">(.+)</script>', page.read_text(encoding="utf-8")
    )
    gloss = [lamp["gloss"] for lamp in json.loads(meta)["light"]["lamps"]]
    # sRGB 0.1 over 0.3, as light; the headlight's
    assert gloss == [pytest.approx(0.137, abs=1e-3), 1]


def test_in_a_notebook_a_complete_page_plays(
    scene: Scene, ripples: Ripples, tmp_path: Path
) -> None:
    with Exporter(scene.model, ripples, tmp_path / "run.html") as exporter:
        exporter.write(forwarded(scene.model))
        assert "not complete" in exporter._repr_html_()
    shown = exporter._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert html.unescape(shown.split('"')[1]) == (tmp_path / "run.html").read_text(encoding="utf-8")


def test_players_show_inside_the_page_of_a_notebook(
    browser: Any, ripples: Ripples, tmp_path: Path
) -> None:
    """Of an exporter, and of a renderer what it rendered last."""
    data = forwarded(ripples.model)
    with Exporter(ripples.model, ripples, tmp_path / "run.html", size=SIZE) as exporter:
        exporter.write(data)
    renderer = RippleRenderer(ripples.model, ripples, width=SIZE[0], height=SIZE[1])
    assert renderer._repr_html_() is None
    ours = renderer.render(data)
    notebook = tmp_path / "notebook.html"
    notebook.write_text(
        f"<!DOCTYPE html><body>{exporter._repr_html_()}{renderer._repr_html_()}</body>",
        encoding="utf-8",
    )
    with opened(browser, notebook) as tab:
        assert len(tab.frames) == 3
        for frame in tab.frames[1:]:
            uri = frame.evaluate("""ripplePlayer.ready.then(player => {
                player.playing = false;
                Object.assign(player.canvas.style, {width: '320px', height: '180px'});
                player.redraw();
                return player.canvas.toDataURL();
            })""")
            assert np.abs(image_of(uri) - ours).mean() < 8  # of 255


def test_a_film_has_every_height_to_half_a_step(browser: Any, film: Path, ours: tuple) -> None:
    with opened(browser, film) as tab:
        tab.evaluate("ripplePlayer.ready")
        assert not tab.evaluate("ripplePlayer.player.live")
        assert tab.evaluate("ripplePlayer.player.frames.count") == FRAMES
        steps = tab.evaluate(
            f"ripplePlayer.player.frames.get({SEEN}).then(f => Array.from(f.steps[0]))"
        )
        step = tab.evaluate("ripplePlayer.player.meta.steps[0]")
    assert np.abs(ours[2]).max() > 20 * step
    assert np.abs(np.array(steps) * step - ours[2]).max() < 0.51 * step


def test_the_browser_shows_the_picture_of_our_renderer(shown: Any, ours: tuple) -> None:
    frame, egg, _ = ours
    shown.evaluate(f"ripplePlayer.player.show({SEEN})")
    difference = np.abs(pixels(shown) - frame)
    assert difference.mean() < 6  # of 255
    assert difference[egg].mean() < 12
    # the outline: where the heights are in colours, and where not
    plain = pixels(shown)
    shown.evaluate("(ripplePlayer.player.heat = true, ripplePlayer.player.redraw())")
    changed = np.abs(pixels(shown) - plain).max(axis=2) > 8
    shown.evaluate("(ripplePlayer.player.heat = false, ripplePlayer.player.redraw())")
    assert (changed & egg).sum() > 0.95 * egg.sum()
    assert (changed & ~egg).sum() < 0.05 * egg.sum()


def test_studio_floor_shadow_and_sky_match_our_renderer(browser, soft_model, tmp_path):
    data = forwarded(soft_model)
    waves = Material(speed=0.3, density=1500.0)
    looks = {"egg": "rubber", "jelly": "jelly"}
    ripples = Ripples(soft_model, {"egg": waves, "jelly": waves}, resolution=8, backend="cpu")
    with Exporter(soft_model, ripples, tmp_path / "run.html", size=SIZE, looks=looks) as exporter:
        exporter.write(data)
    width, height = SIZE
    renderer = RippleRenderer(
        soft_model, ripples, width=width, height=height, looks=looks, lighting="studio"
    )
    with opened(browser, tmp_path / "run.html") as tab:
        tab.evaluate(
            "ripplePlayer.ready.then(player => { player.playing = false; return player.show(0); })"
        )
        shown = pixels(tab)
        difference = np.abs(shown - renderer.render(data))
        assert difference.mean() < 1.4  # of 255; hard shadows and jagged edges are farther away
        assert (difference.max(axis=2) > 40).mean() < 1.5e-3
        floor = "ripplePlayer.player.drawing.floor"
        drawn = (
            f"(ripplePlayer.player.redraw(), {floor}.shadowed.reduce((sum, each) => sum + each))"
        )
        assert 0 < tab.evaluate(drawn) < tab.evaluate(f"0.1 * {floor}.shadowed.length")
        low, high = tab.evaluate(f"{floor}.bare")
        assert (-1 < low < 1) and high == 1
        tab.evaluate(
            f"({floor}.shade = () => {{ {floor}.shadowed.fill(1); }}, {floor}.leaves = () => [-1, "
            f"1])"
        )
        tab.evaluate("ripplePlayer.player.redraw()")
        assert np.abs(pixels(tab) - shown).max() <= 1
        tab.evaluate(
            f"({floor}.shade = () => {{ {floor}.shadowed.fill(0); }}, {floor}.leaves = () => null)"
        )
        tab.evaluate("ripplePlayer.player.redraw()")
        assert (np.abs(pixels(tab) - shown).max(axis=2) > 30).sum() > 100


def test_the_floor_is_lit_right_up_to_the_objects_on_it(browser: Any, tmp_path: Path) -> None:
    floor = '<geom type="plane" size="9 9 1"/>'
    drum = '<geom name="drum" type="cylinder" size="1 .3" pos="0 0 .3"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{floor}{drum}</worldbody></mujoco>")
    data = forwarded(model)
    ripples = Ripples(model, {"drum": Material()}, resolution=16, backend="cpu")
    with Exporter(model, ripples, tmp_path / "run.html", size=(960, 540)) as exporter:
        exporter.write(data)
    ours = RippleRenderer(model, ripples, width=960, height=540).render(data).astype(float)
    with opened(browser, tmp_path / "run.html") as tab:
        tab.set_viewport_size({"width": 960, "height": 540})
        tab.evaluate(
            "ripplePlayer.ready.then(player => { player.playing = false; return player.show(0); })"
        )
        darker = (ours - pixels(tab)).max(axis=2)
    lit = ndimage.binary_erosion(np.abs(ours - ours[-1, 0]).max(axis=2) < 12, iterations=2)
    assert darker[lit].max() < 13  # of 255


def test_a_drag_turns_the_camera_and_the_button_brings_it_back(shown: Any) -> None:
    shown.evaluate(f"ripplePlayer.player.show({SEEN})")
    before = pixels(shown)
    shown.mouse.move(20, 60)  # beside the egg
    shown.mouse.down()
    shown.mouse.move(90, 70, steps=3)
    shown.mouse.up()
    assert np.abs(pixels(shown) - before).mean() > 2
    shown.evaluate("document.getElementById('camera').click()")
    assert np.abs(pixels(shown) - before).mean() < 0.1


def test_contacts_are_arrows(shown: Any) -> None:
    search = (
        "for (let i = 0; ; i++) if ((await ripplePlayer.player.frames.get(i)).arrows.length) "
        "return i;"
    )
    hit = shown.evaluate(f"(async () => {{ {search} }})()")
    shown.evaluate(f"ripplePlayer.player.show({hit})")
    before = pixels(shown)
    shown.evaluate("(ripplePlayer.player.contacts = true, ripplePlayer.player.redraw())")
    assert (np.abs(pixels(shown) - before).max(axis=2) > 30).sum() > 10
    shown.evaluate("(ripplePlayer.player.contacts = false, ripplePlayer.player.redraw())")


def test_a_film_plays_and_draws_each_frame_once(browser: Any, film: Path) -> None:
    with opened(browser, film) as tab:
        tab.evaluate("ripplePlayer.ready")
        tab.wait_for_function("ripplePlayer.player.number > 2")
        # at a tenth of the speed the screen shows frames several times
        tab.evaluate("document.getElementById('speed').value = '0.1'")
        before = tab.evaluate("(ripplePlayer.player.number = 3, ripplePlayer.player.shown)")
        tab.wait_for_function("ripplePlayer.player.number > 6")
        drawn, number = tab.evaluate("[ripplePlayer.player.shown, ripplePlayer.player.number]")
        assert drawn - before <= number - 3 + 2


def test_the_browser_has_moving_surfaces(
    browser: Any, soft_model: mujoco.MjModel, tmp_path: Path
) -> None:
    """A soft body that moves from the first frame, and a geom moved by hand in the second chunk."""
    data = mujoco.MjData(soft_model)
    waves = Material(speed=0.3, density=1500.0)
    ripples = Ripples(soft_model, {"egg": waves, "jelly": waves}, resolution=8, backend="cpu")
    meshes = {name: MovingMesh(ripples[name].rest, triangles=16_000) for name in ripples}
    rest = ripples["egg"].rest.mesh.V
    seen = {}
    with Exporter(soft_model, ripples, tmp_path / "run.html", size=SIZE) as exporter:
        for frame in range(20):
            if frame >= 18:
                ripples["egg"].move(
                    rest * [1.1, 1.0, 1.0 - 0.01 * frame] + 0.02 * np.sin(9 * rest[:, [1, 2, 0]])
                )
            ripples["egg"].add_height(0.001 * ripples["egg"].atlas.normals[..., 0])
            ripples.mj_step(data, nstep=10)
            exporter.write(data)
            for name in ripples:
                height = ripples[name].height
                V = ripples.vertices(name, data)
                seen[frame, name] = meshes[name].shape(height, height, V).points
    with opened(browser, tmp_path / "run.html") as tab:
        tab.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")
        for number, name in enumerate(ripples):
            mesh = meshes[name]
            order = memory_order(mesh.F, mesh.rest)[1]
            size = np.ptp(mesh.rest, axis=0).max()
            for frame in (17, 18, 19, 3):
                tab.evaluate(f"ripplePlayer.player.show({frame})")
                points = tab.evaluate(
                    f"Array.from(ripplePlayer.player.drawing.parts[{number}].data[0])"
                )
                expected = seen[frame, name][order]
                assert np.abs(np.reshape(points, (-1, 3)) - expected).max() < 1e-4 * size
            assert np.abs(seen[19, name] - seen[3, name]).max() > 0.02 * size  # it moves
