"""The viewer's page in a headless browser has the program's waves, and controls the program."""

import dataclasses
import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
import pytest
from chromium import PATIENCE, launched
from pages import opened

import ripple_sim
from ripple_sim import Material, Ripples
from ripple_sim.scene import MaterialEntry, Scene, load_scene
from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.waves.tape import Tape
from ripple_sim.viewer import (
    ALL_TARGETS,
    Command,
    Opened,
    PageView,
    Session,
    open_scene,
    served,
    view_of,
)

SIZE = (320, 180)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as made:
        yield made


@pytest.fixture
def view(ball: Opened, tmp_path: Path) -> PageView:
    session = Session(ball.scene, resolution=12, has_skins=False)
    return view_of(session, tmp_path, 12, ball)


class Page:
    """A page of a view, which runs only while the test waits for something."""

    def __init__(self, tab: Any, view: PageView) -> None:
        self.tab = tab
        self.view = view

    def wait_for(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, "nothing happened"
            self.view.tick()
            self.tab.wait_for_timeout(1)

    def wait_until(self, expression: str) -> None:
        self.wait_for(lambda: self.tab.evaluate(expression))

    def press(self, key: str) -> None:
        self.tab.keyboard.press(key)

    def run(self, seconds: float) -> None:
        """Let the session run for a time, and the page come to its end."""
        session = self.view.session
        end = session.time + seconds
        self.wait_for(lambda: session.time >= end)
        session.paused = True
        self.wait_until("""(async () => {
            const player = ripplePlayer.player;
            await player.work;
            return player.number === player.frames.count - 1;
        })()""")
        self.wait_for(lambda: self.tab.evaluate("ripplePlayer.player.newest") >= self.frames - 1)

    @property
    def frames(self) -> int:
        return self.tab.evaluate("ripplePlayer.player.frames.count")

    def heights(self, owner: str = "ripplePlayer.player") -> np.ndarray:
        """Of the texels, in the page."""
        heights = self.tab.evaluate(
            f"ripplePlayer.player.work.then(() => Array.from({owner}.surfaces[0].solver.read().h))"
        )
        return np.array(heights[:-1])

    def agrees(self) -> bool:
        """Whether the page's heights are the program's within 1 % of the highest."""
        (name,) = self.view.session.simulation.ripples
        height = self.view.session.simulation.ripples[name].height.ravel()
        peak = np.abs(height).max()
        return peak > 0 and np.abs(self.heights() - height).max() < 0.01 * peak


@pytest.fixture
def page(browser: Any, view: PageView) -> Iterator[Page]:
    with (
        served(view.pages, 0, "127.0.0.1") as server,
        opened(browser, server.address, SIZE) as tab,
    ):
        tab.evaluate("ripplePlayer.ready")
        page = Page(tab, view)
        page.wait_until("ripplePlayer.player.newest > 2")
        yield page
        view.close()


def test_pokes_and_balls_reach_the_program_and_waves_are_the_same_in_both(page: Page) -> None:
    session = page.view.session
    page.tab.mouse.click(150, 80)
    page.wait_until("ripplePlayer.player.poked")
    (name,) = session.simulation.ripples
    page.wait_for(lambda: np.abs(session.simulation.ripples[name].height).max() > 1e-3)
    page.press("t")
    page.wait_for(lambda: len(session.parked) < 6)
    page.run(0.3)
    page.wait_for(page.agrees)


def test_changes_of_the_waves_reach_the_page(page: Page) -> None:
    """A reset, another operator and another material: the page gets the new law and the state."""
    session = page.view.session
    page.tab.mouse.click(150, 80)
    page.run(0.1)
    session.paused = False
    page.press("o")
    page.wait_for(lambda: session.operator == "uncorrected")
    page.tab.evaluate("ripplePlayer.player.send('factors', {factors: {speed: 2, stiffness: 2}})")
    (name,) = session.simulation.ripples
    speed = np.max(session.simulation.ripples[name].material.speed)
    page.wait_for(
        lambda: np.max(session.simulation.ripples[name].material.speed) == pytest.approx(2 * speed)
    )
    page.run(0.2)
    page.wait_for(page.agrees)
    page.press("r")
    page.wait_for(lambda: session.time < 0.1)
    page.run(0.05)
    page.wait_for(lambda: not np.abs(page.heights()).any())


def field_of(waves: WaveSolver, texels: Any, values: Any) -> np.ndarray:
    field = np.zeros(waves.operator.mass.size)
    np.add.at(field, texels, values)
    return field.reshape(waves.operator.mass.shape)


def test_another_operator_is_shown_beside_with_waves_of_the_same_loads(page: Page) -> None:
    """The second picture has the heights of a solver with this operator and the same loads."""
    session = page.view.session
    page.tab.click("#tune")
    page.tab.select_option("#compare", "paper")
    page.wait_until("!!ripplePlayer.player.rival")
    page.tab.click("#tune")
    both = page.tab.evaluate("""["view", "rival"].map(id => {
        const {left, right} = document.getElementById(id).getBoundingClientRect();
        return [left, right];
    })""")
    assert both == [[0, 160], [160, 320]]
    (name,) = session.simulation.ripples
    rival = session.simulation.ripples.waves_by(name, "paper")
    tape = Tape()
    session.simulation.ripples[name].record(tape)
    page.tab.mouse.click(235, 80)  # on the right
    page.wait_until("ripplePlayer.player.poked")
    page.run(0.2)
    load = None
    for kind, first, second in tape.take():
        if kind == "load":
            load = Load(first, -second) if len(first) else None  # inwards
        elif kind == "kick":
            rival.add_velocity(field_of(rival, first, second))
        else:
            rival.step(first * second, first, load)
    peak = np.abs(rival.height).max()
    assert peak > 1e-4

    def distance_from(height: np.ndarray) -> float:
        return np.abs(page.heights("ripplePlayer.player.rival") - height.ravel()).max()

    page.wait_for(lambda: distance_from(rival.height) < 0.01 * peak)
    assert distance_from(page.heights()) > 0.05 * peak
    page.tab.evaluate("ripplePlayer.player.send('compare', {name: ''})")
    page.wait_until("!ripplePlayer.player.rival")


def test_pause_holds_the_time_and_a_step_is_one_frame(page: Page) -> None:
    session = page.view.session
    page.press(" ")
    page.wait_for(lambda: session.paused)
    held = session.time
    page.press("n")
    page.wait_for(lambda: session.time > held)
    assert session.time == pytest.approx(held + 1 / session.fps)
    page.wait_until("!ripplePlayer.player.playing")
    page.press(" ")
    page.wait_for(lambda: session.time > held + 0.1)


def test_a_body_is_dragged_with_the_pointer(page: Page) -> None:
    session = page.view.session
    model = session.simulation.model
    data = session.simulation.data
    (ball,) = (
        body
        for body in page.tab.evaluate("ripplePlayer.player.meta.stream.movable")
        if "thrown" not in model.body(body).name
    )
    page.press(" ")
    page.wait_for(lambda: session.paused)
    page.run(0.0)
    x, y = page.tab.evaluate(
        """body => {
        const player = ripplePlayer.player, {matrix} = player.view(player.aspect);
        const [x, y, z] = player.bodies()[body].slice(12, 15);
        const row = k => matrix[k] * x + matrix[4 + k] * y + matrix[8 + k] * z + matrix[12 + k];
        return [160 * (1 + row(0) / row(3)), 90 * (1 - row(1) / row(3))];
    }""",
        ball,
    )
    before = data.xpos[ball].copy()
    page.tab.mouse.move(x, y)
    page.tab.mouse.down()
    page.tab.mouse.move(x + 60, y - 10, steps=4)
    session.paused = False
    page.wait_for(lambda: np.linalg.norm(data.xpos[ball] - before) > 0.1)
    page.tab.mouse.up()
    page.wait_for(lambda: not data.xfrc_applied.any())


def test_pages_and_videos_are_written_to_the_folder(page: Page, opengl: None) -> None:
    folder = page.view.folder
    page.tab.evaluate("ripplePlayer.player.send('share')")
    page.wait_for(lambda: (folder / "sphere-1.html").exists())
    assert 'class="law"' in (folder / "sphere-1.html").read_text(encoding="utf-8")
    page.tab.evaluate("ripplePlayer.player.send('record')")
    page.wait_until("document.getElementById('hint').textContent.startsWith('recording')")
    page.tab.evaluate("ripplePlayer.player.send('record')")
    page.wait_for(lambda: (folder / "sphere-1.mp4").exists())
    page.press("q")
    page.wait_for(lambda: page.view.closed)


@pytest.mark.filterwarnings("ignore:the material holds")  # for waves shorter than these texels
def test_a_saved_scene_shows_what_the_page_shows(page: Page) -> None:
    origin = page.view._origin.scene
    page.tab.click("#tune")
    page.tab.click("#save")
    page.wait_for(lambda: (page.view.folder / "sphere-1.toml").exists())
    saved = load_scene(page.view.folder / "sphere-1.toml")
    assert saved.targets == origin.targets
    assert saved.camera == origin.camera
    page.tab.select_option("#preset", "gelatine-5")
    page.tab.select_option("#look", "metal")
    page.wait_until("ripplePlayer.player.targets[0].metallic === 1")
    page.tab.mouse.move(20, 20)
    page.tab.mouse.down()
    page.tab.mouse.move(60, 20)
    page.tab.mouse.up()
    page.tab.click("#save")
    page.wait_for(lambda: (page.view.folder / "sphere-2.toml").exists())
    saved = load_scene(page.view.folder / "sphere-2.toml")
    assert saved.targets[0].material == MaterialEntry(preset="gelatine-5")
    assert saved.targets[0].look == "metal"
    turned = np.degrees(page.tab.evaluate("ripplePlayer.player.orbit.azimuth"))  # of the eye
    assert (saved.camera.azimuth - turned) % 360 == pytest.approx(180, abs=0.06)
    assert saved.camera.azimuth != origin.camera.azimuth


def test_materials_and_looks_are_chosen_by_target(tmp_path: Path) -> None:
    view = view_of(Session(open_scene("pair"), resolution=9, has_skins=False), tmp_path, 8)
    with pytest.raises(ValueError, match="from 0 to 1, got 2"):
        view._change_look(Command("look", target=2, name="metal"))
    view._change_look(Command("look", target=1, name="metal"))
    view._change_preset(Command("preset", target=0, name="gelatine-3"))
    parts = json.loads(re.search(r'id="meta">(.*)</script>', view.pages.open().text)[1])["parts"]
    assert [part["metallic"] for part in parts if part["target"]] == [0, 1]
    ripples = view.session.simulation.ripples
    left, right = (ripples[name].material for name in ripples)
    assert left.density == Material.preset("gelatine-3").density != right.density
    view._change_look(Command("look", target=ALL_TARGETS, name=""))
    parts = json.loads(re.search(r'id="meta">(.*)</script>', view.pages.open().text)[1])["parts"]
    assert [part["metallic"] for part in parts if part["target"]] == [0, 0]
    view.close()


def test_a_recording_has_the_colours_of_the_targets(tmp_path: Path, opengl: None) -> None:
    """Those of the scene, and of a look that the user has chosen."""
    scene = open_scene("sphere")
    entry = msgspec.structs.replace(scene.targets[0], color=(0.9, 0.05, 0.05))
    red = dataclasses.replace(scene, targets=(entry,))
    view = view_of(Session(red, resolution=9, has_skins=False), tmp_path, 8)
    for look in ("", "metal"):
        view._change_look(Command("look", name=look))
        picture = view._picture().astype(int)
        middle = picture[300:420, 580:700].mean(axis=(0, 1))
        assert middle[0] > 1.5 * middle[1]
        assert middle[0] > 1.5 * middle[2]
    view.close()


def test_a_loop_of_ones_own_is_shown_and_poked(browser: Any, scene: Scene) -> None:
    model = scene.model
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"sphere": Material(speed=0.5, density=200.0)}, resolution=10)
    with (
        ripple_sim.view(model, data, ripples, browser=False) as viewer,
        opened(browser, viewer.address, SIZE) as tab,
    ):
        assert viewer.address in viewer._repr_html_()
        tab.evaluate("ripplePlayer.ready")
        tab.mouse.click(150, 80)
        end = time.monotonic() + PATIENCE
        while not np.abs(ripples["sphere"].height).max() > 1e-4:
            assert time.monotonic() < end
            ripples.mj_step(data, nstep=4)
            viewer.sync()
            tab.wait_for_timeout(1)
        tab.wait_for_function(
            "ripplePlayer.player.surfaces[0].solver.read().h.some(h => Math.abs(h) > 1e-5)"
        )
        tab.keyboard.press("q")
        while viewer.is_running():
            assert time.monotonic() < end
            viewer.sync()
