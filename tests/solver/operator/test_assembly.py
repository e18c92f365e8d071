"""Operators by name, baselines, softened needles; rims against known modes."""

import dataclasses

import numpy as np
import pytest
from hand_made import (
    aslant,
    disk,
    eigenvalues,
    flat_torus,
    polygon,
    square,
    square_eigenvalues,
    two_squares,
)
from modes import mode_error, orders
from scipy.special import erf, jn_zeros, jnp_zeros

from ripple_sim.solver import (
    Material,
    SolverError,
    TexelMesh,
    WaveSolver,
    sphere_atlas,
    texel_atlas,
)


def test_baselines_do_not_converge() -> None:
    # the figures measured when the project was designed: 0.125 at every resolution
    for n in (32, 64):
        assert mode_error(n, "paper") == pytest.approx(0.125, abs=0.005)


def test_needles_do_not_set_the_time_step_of_all() -> None:
    ball = sphere_atlas(1.0, 32)
    assert (ball.texels.softening() == 1).all()
    positions = ball.positions.copy()
    # nine texels almost in one place
    crowd = positions[4, 9:12, 9:12]
    crowd += 0.8 * (crowd[1, 1] - crowd)
    needles = dataclasses.replace(
        ball, texels=ball.texels.with_positions(positions, normals=ball.normals)
    )
    factors = needles.texels.softening()
    assert 1 <= (factors < 1).sum() <= 9
    assert factors.min() < 0.3
    steps = [WaveSolver(atlas, backend="cpu").stable_timestep for atlas in (ball, needles)]
    assert steps[1] > 0.9 * steps[0]


def test_a_narrow_ring_is_not_softened() -> None:
    # one column of squares 0.55 of the others' width, which are 4.5 times as long as wide: all that
    # crosses a thin limb
    n = 192
    widths = np.ones(n + 1)
    widths[[0, -1]] = 0.5
    widths[n // 2] = 0.55
    x = np.concatenate([[0], np.cumsum(widths)])
    y = 4.5 * x[-1] * ((np.arange(n + 2) - 0.5) / n).clip(0, 1)
    places = np.stack([*np.meshgrid(x, y), np.zeros((n + 2, n + 2))], axis=-1)[None]
    texels = TexelMesh.of(square(n).topology, places[:, 1:-1, 1:-1], beyond=places)
    texels = dataclasses.replace(texels, areas=texels.cells.areas)
    mode = np.cos(np.pi * texels.positions[..., 0] / x[-1])
    stiffness = texels.stencil(np.ones_like(mode), texels.softening())
    square_frequency = -np.sum(mode * stiffness(mode)) / np.sum(texels.areas * mode**2)
    assert square_frequency == pytest.approx((np.pi / x[-1]) ** 2, rel=1e-4)


def test_smooth_surfaces_gain_time_step_and_keep_mass_and_order_of_eigenvalues() -> None:
    errors = []
    for n in (24, 48, 96):
        u = ((np.arange(n + 2) - 0.5) / n).clip(0, 1)  # a unit square, dense in the middle
        x, y = np.meshgrid(*2 * [(u - 0.45 * 0.05 * erf((u - 0.5) / 0.05) - 0.0225) / 0.955])
        places = np.stack([x, y, 0 * x], axis=-1)[None]
        texels = TexelMesh.of(square(n).topology, places[:, 1:-1, 1:-1], beyond=places)
        spanned = dataclasses.replace(texels, areas=texels.cells.areas)
        moved = texels.areas - spanned.areas
        assert moved.max() > 0
        assert moved.sum() == pytest.approx(0, abs=1e-12)
        np.testing.assert_allclose(np.einsum("cij,cijk->k", moved, texels.positions), 0, atol=1e-12)
        np.testing.assert_allclose(texels.softening(), 1, atol=1e-9)
        steps = [texel_atlas(each).quality()["timestep"] for each in (texels, spanned)]
        assert steps[0] > 1.03 * steps[1]
        found = eigenvalues(texels, MODES + 1)[1:]
        errors.append(
            np.sqrt(np.mean((found / square_eigenvalues("free")[1 : MODES + 1] - 1) ** 2))
        )
    assert (orders(errors) > 1.9).all()


def test_unknown_names_list_the_valid_ones() -> None:
    atlas = sphere_atlas(1.0, 8)
    with pytest.raises(SolverError, match="'fem', 'paper'"):
        WaveSolver(atlas, backend="cpu", operator="spectral")
    with pytest.raises(SolverError, match="the atlas needs"):
        WaveSolver(atlas, Material(speed=np.ones((6, 16, 16))), backend="cpu")


def test_a_load_on_a_map_that_fades_to_zero_does_not_sink_in_for_ever(backend: str) -> None:
    atlas = sphere_atlas(1.0, 24)
    fading = np.clip(1 - 2 * atlas.positions[..., 2], 0, 1) ** 4
    waves = WaveSolver(atlas, Material(speed=fading, damping=5.0), backend=backend)
    waves.add_force([0.9, 0, 0.45], 1.0, 0.2)
    waves.step(20.0)
    deepest = np.abs(waves.height)
    usual = WaveSolver(atlas, Material(damping=5.0), backend=backend)
    usual.add_force([0.9, 0, 0.45], 1.0, 0.2)
    usual.step(20.0)
    assert not deepest[fading == 0].any()
    assert deepest.max() < 100 * np.abs(usual.height).max()


@pytest.mark.parametrize("rim", ["free", "fixed"])
@pytest.mark.parametrize("operator", ["paper", "uncorrected", "dynamic-paint"])
@pytest.mark.parametrize(
    "texels",
    [square(8), disk(8), polygon(3, 8), polygon(6, 8), flat_torus(8), two_squares(8)],
    ids=["square", "disk", "triple", "irregular", "periodic", "two parts"],
)
def test_baselines_run_on_any_texel_mesh(
    texels: TexelMesh, operator: str, rim: str, backend: str
) -> None:
    waves = WaveSolver(
        texel_atlas(texels), Material(damping=0.1), backend=backend, operator=operator, rim=rim
    )
    waves.add_impulse(texels.positions[-1, 3, 4], 1.0, 0.3)
    assert 0 < waves.stable_timestep < np.inf
    waves.step(0.05)
    first = np.abs(waves.height).max()
    waves.step(300 * waves.stable_timestep)
    assert 0 < np.abs(waves.height).max() < 10 * first
    matrix = waves.operator.stencil
    noise = np.random.default_rng(0).standard_normal((2, *texels.shape))
    assert (noise[0] * matrix(noise[1])).sum() == pytest.approx((noise[1] * matrix(noise[0])).sum())


def ending(n: int) -> TexelMesh:
    """Unit square that ends at its last texels."""
    x, y = np.meshgrid(*2 * [np.linspace(0, 1, n + 1)])
    return TexelMesh.of(square(n + 1).topology, np.stack([x, y, 0 * x], axis=-1)[None])


@pytest.mark.parametrize(
    ("shape", "operator", "rim", "least"),
    [
        (ending, "fem", "free", 1.9),
        (ending, "fem", "fixed", 1.9),
        # baselines converge where the texels are even squares
        (square, "paper", "free", 1.8),
        (square, "uncorrected", "free", 1.8),
    ],
)
def test_a_mode_of_the_square_comes_back_to_second_order(
    shape, operator: str, rim: str, least: float
) -> None:
    errors = []
    wave = np.sin if rim == "fixed" else np.cos
    for n in (12, 24, 48):
        texels = shape(n)
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        mode = wave(np.pi * x) * wave(2 * np.pi * y)
        waves = WaveSolver(
            texel_atlas(texels), backend="cpu", operator=operator, rim=rim, conserve_volume=False
        )
        waves.height = mode
        waves.step(2 / np.sqrt(5))
        errors.append(np.abs(waves.height - mode).max())
        assert rim == "free" or not (waves.height[0, 0].any() or waves.height[0, :, -1].any())
    assert (orders(errors) > least).all()


MODES = 12


def disk_modes(rim: str) -> np.ndarray:
    roots = [jn_zeros(m, 6) if rim == "fixed" else jnp_zeros(m, 6) for m in range(10)]
    twice = [
        root for m, found in enumerate(roots) for root in found for _ in range(1 if m == 0 else 2)
    ]
    return np.sort([0.0, *twice] if rim == "free" else twice) ** 2


@pytest.mark.parametrize("rim", ["free", "fixed"])
@pytest.mark.parametrize(
    ("shape", "modes"),
    [
        (square, square_eigenvalues),
        (lambda n: aslant(n, 0.5), square_eigenvalues),
        (disk, disk_modes),
    ],
    ids=["square", "aslant", "disk"],
)
def test_eigenvalues_converge_at_second_order(shape, modes, rim: str) -> None:
    exact = modes(rim)[1 : MODES + 1]
    errors = []
    for n in (12, 24, 48):
        texels = shape(n).with_fixed_rim() if rim == "fixed" else shape(n)
        found = eigenvalues(texels, MODES + 1)[1:]
        errors.append(np.sqrt(np.mean((found / exact - 1) ** 2)))
    order = -np.polyfit(np.log([12, 24, 48]), np.log(errors), 1)[0]
    assert order > 1.9
    assert errors[-1] < 6e-3


def test_a_drum_skin_swings_in_its_mode_and_keeps_its_energy(backend: str) -> None:
    errors = []
    for n in (12, 24, 48):
        texels = square(n)
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        mode = np.sin(np.pi * x) * np.sin(2 * np.pi * y)
        waves = WaveSolver(
            texel_atlas(texels), Material(), backend=backend, rim="fixed", conserve_volume=False
        )
        waves.height = mode
        waves.step(waves.stable_timestep, 1)
        energy = waves.energy()
        waves.height = mode
        waves.velocity = 0.0
        period = 2 / np.sqrt(5)
        steps = int(np.ceil(period / waves.stable_timestep))
        waves.step(period, steps)
        errors.append(np.abs(waves.height - mode).max())
        assert waves.energy() == pytest.approx(energy, rel=0.01)
    assert (orders(errors) > 1.8).all()


def test_waves_come_back_inverted_from_a_fixed_rim_and_upright_from_a_free_one() -> None:
    texels = square(96)
    x = texels.positions[..., 0]
    pulse = np.exp(-(((x - 0.5) / 0.08) ** 2))
    for rim, sign in (("free", 1), ("fixed", -1)):
        waves = WaveSolver(texel_atlas(texels), backend="cpu", rim=rim, conserve_volume=False)
        waves.height = pulse
        waves.velocity = 2 * (x - 0.5) / 0.08**2 * pulse
        waves.step(1.0)
        middle = waves.height[0, 48]
        assert middle[np.abs(middle).argmax()] == pytest.approx(sign, abs=0.05)


def test_the_rim_of_a_closed_surface_has_no_effect_and_a_bad_name_is_refused() -> None:
    atlas = sphere_atlas(1.0, 8)
    heights = []
    for rim in ("free", "fixed"):
        waves = WaveSolver(atlas, backend="cpu", rim=rim)
        waves.add_impulse([0, 0, 1], 1.0, 0.5)
        waves.step(0.2)
        heights.append(waves.height)
    np.testing.assert_array_equal(*heights)
    message = "rim must be one of 'free', 'supported', 'clamped', 'fixed', got 'bent'"
    with pytest.raises(SolverError, match=message):
        WaveSolver(atlas, backend="cpu", rim="bent")
