"""Pages that solve the waves themselves: their heights are the solver's, and they can be poked."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco_models import forwarded
from pages import opened

from ripple_sim import Exporter, Material, Ripples, Scene, Target

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
