"""Sensors against closed forms of a sphere and a membrane; both backends; blocks."""

import itertools

import numpy as np
import pytest
from hand_made import square
from scipy.special import eval_legendre

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.waves.sensor import KINDS, filtered

POINTS = np.array([[0.3, -0.2, 0.9], [0.577, 0.577, 0.577], [-0.9, 0.1, -0.4]])


def levels(signals: np.ndarray, rate: float, edges: np.ndarray) -> np.ndarray:
    """Level of signals [k, points], the mean of all, in bands between frequencies [dB]."""
    power = (np.abs(np.fft.rfft(signals * np.hanning(len(signals))[:, None], axis=0)) ** 2).mean(
        axis=1
    )
    frequency = np.fft.rfftfreq(len(signals), 1 / rate)
    bands = [(low <= frequency) & (frequency < high) for low, high in itertools.pairwise(edges)]
    return 10 * np.log10([power[band].sum() for band in bands])


def test_modes_of_a_sphere_within_a_decibel_up_to_five_texels_a_wave() -> None:
    atlas = sphere_atlas(1.0, 24)
    damping = 0.2
    waves = WaveSolver(atlas, Material(speed=1.0, damping=damping), backend="cpu")
    degrees = np.array([2, 5, 9, 13, 17])
    rates = np.sqrt(degrees * (degrees + 1) - damping**2 / 4)
    # all over the sphere: the grid hands some of a mode on to others of its degree
    sensor = waves.sensor(atlas.positions[:, 1::4, 2::4].reshape(-1, 3), rate=60.0)
    assert sensor.bandwidth < 0.34 * 60
    waves.velocity = sum(eval_legendre(degree, atlas.positions[..., 2]) for degree in degrees)
    sensor.begin(0.0, sensor.probes.of(waves.height, waves.velocity))
    waves.step(40.0)
    times, samples = sensor.read()
    shapes = [
        eval_legendre(degree, sensor.points[:, 2] / np.linalg.norm(sensor.points, axis=1))
        for degree in degrees
    ]
    w = rates
    t = times[:, None]
    swings = -np.exp(-damping * t / 2) * (
        damping * np.cos(w * t) + (w - damping**2 / 4 / w) * np.sin(w * t)
    )
    exact = swings @ np.stack(shapes)
    edges = np.append(0.5 * rates[0], (rates[1:] + rates[:-1]) / 2) / (2 * np.pi)
    edges = np.append(edges, sensor.bandwidth)
    # wide texels are a third wider than the mean
    assert rates[-1] / (2 * np.pi) < sensor.bandwidth < 20 / (2 * np.pi)
    error = levels(samples[30:], 60, edges) - levels(exact[30:], 60, edges)
    assert np.abs(error).max() < 1.0


@pytest.mark.parametrize(
    ("speed", "bending"), [(3.0, 0.0), (0.0, 3.6e-3)], ids=["membrane", "plate"]
)
def test_a_struck_sheet_against_modal_superposition(speed: float, bending: float) -> None:
    """Held at the rim, a plate without a moment there, it has sines for modes."""
    n = 40
    damping = 0.5
    atlas = texel_atlas(square(n))
    material = Material(speed=speed, bending=bending, damping=damping)
    waves = WaveSolver(atlas, material, rim="fixed", conserve_volume=False, backend="cpu")
    here = np.array([0.31, 0.63, 0.0])
    sensor = waves.sensor(here, kind="velocity", rate=200.0)
    x, y = np.moveaxis(atlas.positions[..., :2], -1, 0)
    waves.velocity = np.exp(-((x - 0.4) ** 2 + (y - 0.55) ** 2) / (2 * 0.03**2))
    sensor.begin(0.0, sensor.probes.of(waves.height, waves.velocity))
    waves.step(8.0)
    times, samples = sensor.read()
    m = np.arange(1, 26)
    sines = [np.sin(np.pi * m * each) for each in (0.4, 0.55, *here[:2])]
    narrow = 2 * np.sqrt(2 * np.pi) * 0.03 * np.exp(-((np.pi * m * 0.03) ** 2) / 2)
    weights = np.outer(sines[0] * narrow * sines[2], sines[1] * narrow * sines[3])
    square_of = np.pi**2 * (m[:, None] ** 2 + m**2)
    rates = np.sqrt(speed**2 * square_of + bending * square_of**2 - damping**2 / 4)
    exact = np.zeros(len(times))
    for weight, w in zip(weights.ravel(), rates.ravel(), strict=True):
        exact += (
            weight
            * np.exp(-damping * times / 2)
            * (np.cos(w * times) - damping / 2 / w * np.sin(w * times))
        )
    hertz = np.unique(rates[rates < 2 * np.pi * sensor.bandwidth].round(6)) / (2 * np.pi)
    widest = np.sort(np.argsort(hertz[1:] / hertz[:-1])[-5:])  # bands end where no mode is
    edges = np.array([hertz[0] / 2, *np.sqrt(hertz[widest] * hertz[widest + 1]), sensor.bandwidth])
    shortest = 2 * np.pi * n / 5
    highest = np.sqrt(speed**2 * shortest**2 + bending * shortest**4) / (2 * np.pi)
    assert sensor.bandwidth == pytest.approx(highest, rel=0.01)
    error = levels(samples[30:], 200, edges) - levels(exact[30:, None], 200, edges)
    assert np.abs(error).max() < 1.0


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_strain_is_within_a_decibel_up_to_the_bandwidth(share: float) -> None:
    atlas = sphere_atlas(1.0, 24)
    thickness = 1e-2
    rng = np.random.default_rng(0)
    points = rng.normal(size=(150, 3))
    axis = np.array([0.304, 0.507, 0.806])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    sensor = waves.sensor(points, "strain", 60.0, thickness=thickness)
    degree = round(share * 2 * np.pi * sensor.bandwidth)
    omega = np.sqrt(degree * (degree + 1))
    waves.velocity = eval_legendre(degree, atlas.positions @ axis)
    sensor.begin(0.0, sensor.probes.of(waves.height, waves.velocity))
    waves.step(12.0)
    times, samples = (each[20:] for each in sensor.read())
    exact = np.outer(
        np.sin(omega * times), thickness / 4 * omega * eval_legendre(degree, points @ axis)
    )
    assert abs(10 * np.log10((samples.astype(float) ** 2).sum() / (exact**2).sum())) < 1.0


def test_strain_beside_a_rim_is_that_of_the_wave_there() -> None:
    """One-sided fits of too few texels were three times too high."""
    n = 24
    atlas = texel_atlas(square(n))
    rng = np.random.default_rng(1)
    points = np.stack([rng.uniform(0.1, 0.9, 60), rng.uniform(0.0, 0.04, 60), np.zeros(60)], axis=1)
    sensor = WaveSolver(atlas, backend="cpu").sensor(points, "strain", 100.0, thickness=4.0)
    wave = 2 * np.pi * n / 20 * np.array([0.6, 0.8, 0.0])
    found = sensor.probes.of(np.sin(atlas.positions @ wave), np.zeros(atlas.areas.shape))
    exact = (wave @ wave) * np.sin(sensor.points @ wave)
    assert np.sqrt(((found - exact) ** 2).mean()) < 0.1 * wave @ wave


@pytest.mark.parametrize(
    "material",
    [Material(speed=1.0, viscosity=1e-3), Material.dent(1e-4, speed=1.0, stiffness=200.0)],
    ids=["viscous", "dent"],
)
def test_both_backends_give_the_same_samples(opengl: None, material: Material) -> None:
    runs = []
    for backend in ("cpu", "gl"):
        waves = WaveSolver(sphere_atlas(1.0, 16), material, backend=backend)
        sensors = [
            waves.sensor(POINTS, kind, 100.0, thickness=0.02 if kind == "strain" else None)
            for kind in KINDS
        ]
        waves.step(0.1)
        waves.add_impulse([0.4, 0.0, 0.9], 0.01, 0.3)
        waves.add_pressure(0.01)
        for _ in range(20):
            waves.step(0.06)
        runs.append([sensor.read() for sensor in sensors])
    for cpu, gl in zip(*runs, strict=True):
        np.testing.assert_array_equal(cpu.times, gl.times)
        np.testing.assert_allclose(gl.values, cpu.values, atol=1e-5 * np.abs(cpu.values).max())


def test_samples_do_not_depend_on_when_they_are_read_and_have_exact_times() -> None:
    def run(*, often: bool) -> tuple[np.ndarray, np.ndarray]:
        waves = WaveSolver(sphere_atlas(1.0, 16), backend="cpu")
        waves.step(0.3)
        sensor = waves.sensor(POINTS, "height", 50.0)
        blocks = []
        waves.add_impulse([0, 0, 1], 1.0, 0.3)
        for step in range(30):
            waves.step(0.1 if step % 3 else 0.07)  # substeps of several lengths
            blocks += [sensor.read()] if often else []
        times, values = map(np.concatenate, zip(*blocks, sensor.read(), strict=True))
        assert times[-1] > waves.time - sensor.latency - 1 / 50
        return times, values

    (times, values) = run(often=True)
    (_, together) = run(often=False)
    np.testing.assert_array_equal(values, together)
    np.testing.assert_allclose(times, 0.3 + np.arange(len(times)) / 50, rtol=1e-15)


def test_a_constant_stays_constant_and_a_reset_restarts() -> None:
    waves = WaveSolver(
        sphere_atlas(1.0, 16), Material(speed=1.0), backend="cpu", conserve_volume=False
    )
    waves.height = 0.25
    sensor = waves.sensor(POINTS, "height", 30.0)
    waves.step(2.0)
    np.testing.assert_allclose(sensor.samples, 0.25, rtol=1e-5)
    waves.reset()
    assert len(sensor.times) == 0
    waves.step(2.0)
    np.testing.assert_array_equal(sensor.samples, 0.0)
    waves.listeners.use([])
    before = len(sensor.read().times)
    waves.step(1.0)
    assert before > 0 and len(sensor.times) == 0


def test_the_filter_passes_a_third_of_the_rate_and_blocks_half_of_it() -> None:
    times = np.arange(4000) / 1000
    at = 0.5 + np.arange(200) / 100
    values = np.stack(
        [np.cos(2 * np.pi * hertz * times + 0.3) for hertz in (3, 20, 34, 50, 70, 230)], axis=1
    )
    kept = filtered(times, np.full(len(times), 1e-3), values, at, 100.0)
    exact = np.stack([np.cos(2 * np.pi * hertz * at + 0.3) for hertz in (3, 20, 34)], axis=1)
    assert np.abs(kept[:, :3] - exact).max() < 2e-4  # 80 dB
    assert np.abs(kept[:, 3:]).max() < 2e-4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"kind": "pressure"},
            "sensor kind must be one of 'acceleration', .*'height', 'strain', got 'pressure'",
        ),
        ({"rate": 0}, "sensor rate must be a finite number greater than 0.*, got 0"),
        (
            {"kind": "strain"},
            "sensor thickness must be a finite number greater than 0 for .* 'strain'.*, got None",
        ),
        ({"at": "tip"}, "sensor at 'tip': this surface knows no names; give points"),
    ],
)
def test_invalid_sensors_are_refused(arguments: dict, message: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=message):
        waves.sensor(**{"at": [0, 0, 1.0], **arguments})
