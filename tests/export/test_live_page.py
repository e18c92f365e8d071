"""Pages that solve the waves themselves: their heights are the solver's, and they can be poked."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco_models import forwarded
from pages import opened, pixels

from ripple_sim import (
    Exporter,
    ExportOptions,
    Material,
    Ripples,
    RippleWarning,
    Scene,
    Target,
    export_scene,
)

STEPS = 8  # physics steps in a frame
FRAMES = 20

# a block that moves, under a ball
BLOCK = """<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
<geom name="floor" type="plane" size="2 2 .1" pos="0 0 -0.5"/>
<body name="cart"><joint type="slide" axis="1 0 0"/>
<geom name="block" type="box" size="0.3 0.25 0.2"/></body>
<body pos="0.05 0.02 0.242"><freejoint/><geom name="ball" size="0.05" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""

# a sheet with a rim, under a ball
SHEET = """<mujoco><option timestep="0.002"/>
<asset><hfield name="sheet" nrow="9" ncol="9" size=".5 .5 .1 .1"/></asset>
<worldbody><light pos="0 0 3"/><geom name="sheet" type="hfield" hfield="sheet"/>
<body pos="0.05 0.02 0.055"><freejoint/><geom name="ball" size="0.05" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""


def egg(model: mujoco.MjModel) -> Ripples:
    """The cube layout; viscosity in proportion to tension, and a disc that is held still."""
    material = Material(speed=0.5, density=900.0, damping=1.0, stiffness=60.0, viscosity=2e-4)
    ripples = Ripples(model, {"egg": material}, resolution=12, backend="cpu")
    ripples.make_rigid("egg", [0.0, 0.25, 0.0], 0.1)
    return ripples


def block(model: mujoco.MjModel) -> Ripples:
    """Patches; fields of all coefficients, also of the density, with a volume that is kept."""
    bare = Ripples(
        model, {"block": Target(Material(), resolution=10, layout="patches")}, backend="cpu"
    )
    shares = np.random.default_rng(4).random(bare["block"].atlas.areas.shape)
    material = Material(
        speed=0.4 + 0.2 * shares,
        density=900.0 + 300.0 * shares,
        damping=2.0 * shares,
        viscosity=2e-4 * shares,
    )
    target = Target(material, resolution=10, layout="patches")
    return Ripples(model, {"block": target}, backend="cpu")


def plate(model: mujoco.MjModel) -> Ripples:
    """A plate whose rim is supported."""
    material = Material(speed=0.3, density=40.0, bending=2e-3, damping=2.0)
    target = Target(material, resolution=12, rim="supported")
    return Ripples(model, {"sheet": target}, backend="cpu")


SCENES = {"egg": (None, egg), "block": (BLOCK, block), "plate": (SHEET, plate)}


class Run:
    """A page of a run, and the heights of its target at every frame, [frames, T]."""

    def __init__(self, model: mujoco.MjModel, ripples: Ripples, path: Path) -> None:
        self.path = path
        (self.name,) = ripples
        self.waves = ripples[self.name]
        data = forwarded(model)
        if model.nu == 0 and model.nv > 6:
            data.qvel[0] = 0.3  # the cart moves
        heights = []
        with Exporter(model, ripples, path, fps=60, size=(320, 180)) as exporter:
            for frame in range(FRAMES):
                if frame:
                    ripples.mj_step(data, nstep=STEPS)
                exporter.write(data)
                heights.append(self.waves.height.ravel())
        self.heights = np.array(heights)


@pytest.fixture(scope="module", params=SCENES)
def run(request: Any, scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Run:
    xml, ripples_of = SCENES[request.param]
    model = scene.model if xml is None else mujoco.MjModel.from_xml_string(xml)
    path = tmp_path_factory.mktemp("live") / "run.html"
    return Run(model, ripples_of(model), path)


@pytest.fixture(scope="module")
def page(run: Run, browser: Any) -> Iterator[Any]:
    with opened(browser, run.path) as tab:
        tab.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")
        yield tab


def heights_of(tab: Any, frames: int = FRAMES) -> np.ndarray:
    """Heights of the first target at every frame, from the beginning."""
    return np.array(
        tab.evaluate(
            """async frames => {
        const player = ripplePlayer.player, [surface] = player.surfaces, heights = [];
        await player.restart();
        for (let frame = 0; frame < frames; frame++) {
            await player.show(frame);
            heights.push(Array.from(surface.solver.read().h.subarray(0, surface.law.count)));
        }
        return heights;
    }""",
            frames,
        )
    )


@pytest.mark.parametrize("kind", ["loop", "pass"])
def test_heights_are_the_solvers_at_every_frame(run: Run, page: Any, kind: str) -> None:
    page.evaluate(f"ripplePlayer.player.chooseSolvers('{kind}')")
    used = page.evaluate("ripplePlayer.player.surfaces[0].solver.constructor.name")
    assert used == ("WaveLoop" if kind == "loop" or run.name == "block" else "WavePass")
    peak = np.abs(run.heights).max()
    assert peak > 1e-3
    assert np.abs(heights_of(page) - run.heights).max() < 0.01 * peak


def test_going_back_gives_the_same_heights(run: Run, page: Any) -> None:
    page.evaluate("ripplePlayer.player.chooseSolvers('loop')")
    there = heights_of(page)
    page.evaluate("ripplePlayer.player.show(6)")
    assert page.evaluate("ripplePlayer.player.timeline.frame") == 6
    again = page.evaluate("Array.from(ripplePlayer.player.surfaces[0].solver.h)")[:-1]
    assert np.abs(there[6]).max() > 0
    assert np.abs(again - there[6]).max() < 1e-6 * np.abs(there).max()


def test_a_click_pokes_the_surface_under_the_pointer(run: Run, page: Any) -> None:
    """Its momentum is the impulse, as far as nothing holds the surface, and no mean remains."""
    page.evaluate("ripplePlayer.player.restart()")
    before = page.evaluate("ripplePlayer.player.surfaces[0].state.v.some(Boolean)")
    assert not before
    page.evaluate("ripplePlayer.player.liveOn = () => Promise.resolve()")
    page.evaluate("ripplePlayer.player.show = () => Promise.resolve()")
    spot = page.evaluate("""(() => {
        for (let y = 0.9; y > -0.9; y -= 0.1) for (let x = -0.6; x < 0.6; x += 0.1) {
            if (ripplePlayer.player.pick(x, y)) return [x, y - 0.1];
        }
    })()""")
    page.mouse.click(160 * (1 + spot[0]), 90 * (1 - spot[1]))
    pressed = page.evaluate("""(() => {
        const [{law, solver: {v}, pulse}] = ripplePlayer.player.surfaces;
        const sum = weight => law.mass.reduce((sum, mass, i) => sum + weight(i) * mass * v[i], 0);
        const size = Array.from(v).reduce((most, x) => Math.max(most, Math.abs(x)), 0);
        return [size, sum(i => 1), sum(i => law.inverseDensity[i]), pulse];
    })()""")
    size, momentum, volume, pulse = pressed
    assert size > 0
    assert page.evaluate("ripplePlayer.player.poked")
    if run.waves.conserve_volume:
        assert abs(volume) < 1e-3 * pulse
    else:
        assert momentum == pytest.approx(-pulse, rel=0.02)
    page.reload()
    page.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")


def test_a_coarse_law_keeps_the_energy(browser: Any, tmp_path: Path) -> None:
    """Weights have 11 digits in the page, the same ones at both ends of a link."""
    model = mujoco.MjModel.from_xml_string(BLOCK)
    target = Target(Material(speed=0.5, density=900.0), resolution=10, layout="patches")
    ripples = Ripples(model, {"block": target}, backend="cpu")
    ripples["block"].add_impulse([0.3, 0.0, 0.0], 1.0, 0.1)
    with Exporter(model, ripples, tmp_path / "run.html") as exporter:
        exporter.write(forwarded(model))
    with opened(browser, tmp_path / "run.html") as tab:
        energies = tab.evaluate("""ripplePlayer.ready.then(player => {
            player.playing = false;
            const [surface] = player.surfaces, {law} = surface;
            const dt = 0.98 * ripplePlayer.longestStep(law);
            const {begins, others, elastic, mass, count} = law;
            const links = x => {
                let sum = 0;
                for (let i = 0; i < count; i++) for (let k = begins[i]; k < begins[i + 1]; k++) {
                    sum += elastic[k] * (x[others[k]] - x[i]) ** 2 / 4;
                }
                return sum;
            };
            // conserved by leapfrog: 1/2 v M v - dt^2/8 v K v + 1/2 h K h
            const kinetic = v => mass.reduce((sum, m, i) => sum + m * v[i] ** 2 / 2, 0);
            const energy = ({h, v}) => kinetic(v) + links(h) - dt ** 2 / 4 * links(v);
            const energies = [];
            for (let i = 0; i <= 10; i++) {
                energies.push(energy(surface.solver.read()));
                surface.step(1000, dt);
            }
            return energies;
        })""")
    assert energies[0] > 0
    assert np.abs(np.array(energies) / energies[0] - 1).max() < 1e-3


@pytest.fixture(scope="module")
def egg_page(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("egg") / "run.html"
    ripples = egg(scene.model)
    with Exporter(scene.model, ripples, path, fps=60, size=(320, 180)) as exporter:
        data = forwarded(scene.model)
        for _ in range(4):
            ripples.mj_step(data, nstep=STEPS)
            exporter.write(data)
    return path


def highest(tab: Any) -> float:
    return tab.evaluate(
        "ripplePlayer.player.surfaces[0].solver.read().h.reduce((most, h) => Math.max(most, h), 0)"
    )


def test_the_object_lives_on_after_the_end_and_keys_and_touch_reach_it(
    browser: Any, egg_page: Path
) -> None:
    """On a phone: 360 pixels wide, three of the screen's to each."""
    with opened(browser, egg_page, (360, 640), has_touch=True, device_scale_factor=3) as tab:
        tab.evaluate("ripplePlayer.ready")
        assert tab.evaluate("document.documentElement.scrollWidth") <= 360
        tab.wait_for_function("ripplePlayer.player.number >= 3")
        x, y = tab.evaluate("""(() => {
            const {width, height} = ripplePlayer.player.canvas.getBoundingClientRect();
            for (let y = 0; y < 1; y += 0.05) if (ripplePlayer.player.pick(0, -y)) {
                return [width / 2, (1 + y + 0.05) / 2 * height];
            }
        })()""")
        before = highest(tab)
        tab.touchscreen.tap(x, y)
        tab.wait_for_function("ripplePlayer.player.poked")
        tab.wait_for_function(
            f"ripplePlayer.player.surfaces[0].solver.read().h.some(h => h > {before} + 1e-4)"
        )
        assert tab.evaluate("document.getElementById('hint').className") == "gone"
        tab.keyboard.press("Space")
        assert not tab.evaluate("ripplePlayer.player.playing")
        tab.keyboard.press("c")
        assert tab.evaluate("ripplePlayer.player.heat")
        tab.keyboard.press("g")
        assert tab.evaluate("ripplePlayer.player.grid")
        with tab.expect_download() as download:
            tab.keyboard.press("s")
        assert download.value.suggested_filename == "egg.png"


def test_faster_waves_take_more_substeps_and_stay_finite(browser: Any, egg_page: Path) -> None:
    with opened(browser, egg_page) as tab:
        tab.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")
        tab.click("#tune")
        tab.evaluate("""(() => { for (const id of ["wave-speed", "stiffness"]) {
            const slider = document.getElementById(id);
            slider.value = 1;
            slider.oninput();
        } })()""")
        speed, stiffness = tab.evaluate("""(() => {
            const {speed, stiffness} = ripplePlayer.player.surfaces[0].sliders;
            return [speed, stiffness];
        })()""")
        assert (speed, stiffness) == (4, 4)
        spot = tab.evaluate("[0, 0.2]")
        tab.evaluate("spot => ripplePlayer.player.poke(ripplePlayer.player.pick(...spot), 1)", spot)
        tab.evaluate("ripplePlayer.player.liveOn(5)")
        assert 0 < highest(tab) < 0.1


def test_a_lost_graphics_card_comes_back_with_the_waves(browser: Any, egg_page: Path) -> None:
    with opened(browser, egg_page) as tab:
        tab.evaluate("ripplePlayer.ready.then(player => { player.playing = false; })")
        tab.evaluate("ripplePlayer.player.chooseSolvers('pass')")
        tab.evaluate("ripplePlayer.player.poke(ripplePlayer.player.pick(0, 0.2), 1)")
        tab.evaluate("ripplePlayer.player.liveOn(0.1)")
        before = tab.evaluate("Array.from(ripplePlayer.player.surfaces[0].solver.read().h)")
        picture = pixels(tab)
        tab.evaluate("""(() => {
            window.card = ripplePlayer.player.drawing.gl.getExtension("WEBGL_lose_context");
            card.loseContext();
        })()""")
        tab.wait_for_function("ripplePlayer.player.drawing.lost")
        tab.evaluate("card.restoreContext()")
        tab.wait_for_function("!ripplePlayer.player.drawing.lost")
        tab.evaluate("ripplePlayer.player.paint()")
        after = tab.evaluate("Array.from(ripplePlayer.player.surfaces[0].solver.read().h)")
        assert np.abs(before).max() > 0
        assert after == before
        assert np.abs(pixels(tab) - picture).mean() < 0.5  # of 255


def test_a_browser_without_webgl_shows_a_message(browser: Any, egg_page: Path) -> None:
    tab = browser.new_page()
    tab.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    tab.goto(egg_page.as_uri())
    tab.wait_for_function("document.getElementById('hint').textContent.includes('WebGL 2')")
    tab.close()


def test_a_page_names_the_targets_that_it_replays_with_the_reason(
    scene: Scene, tmp_path: Path
) -> None:
    material = Material(speed=0.5, density=900.0, yield_height=0.01)
    ripples = Ripples(scene.model, {"egg": material}, resolution=8, backend="cpu")
    with (
        pytest.warns(RippleWarning, match="replays 'egg'.*keeps dents"),
        Exporter(scene.model, ripples, tmp_path / "dents.html") as exporter,
    ):
        exporter.write(forwarded(scene.model))
    assert 'class="law"' not in (tmp_path / "dents.html").read_text(encoding="utf-8")
    export_scene(scene, tmp_path / "film.html", ExportOptions(duration=0.02, replay=True))
    assert 'class="law"' not in (tmp_path / "film.html").read_text(encoding="utf-8")
