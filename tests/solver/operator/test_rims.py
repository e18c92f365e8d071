"""Free and fixed rims of open surfaces, against modes that are known exactly."""

import numpy as np
import pytest
from hand_made import aslant, disk, eigenvalues, polygon, square
from scipy.special import jn_zeros, jnp_zeros

from ripple_sim.solver import Material, SolverError, TexelMesh, WaveSolver, sphere_atlas, texel_atlas

MODES = 12


def square_modes(rim: str) -> np.ndarray:
    first = 1 if rim == "fixed" else 0
    return np.sort([np.pi**2 * (a * a + b * b) for a in range(first, 9) for b in range(first, 9)])


def disk_modes(rim: str) -> np.ndarray:
    roots = [jn_zeros(m, 6) if rim == "fixed" else jnp_zeros(m, 6) for m in range(10)]
    twice = [root for m, found in enumerate(roots) for root in found for _ in range(1 if m == 0 else 2)]
    return np.sort([0.0, *twice] if rim == "free" else twice) ** 2


@pytest.mark.parametrize("rim", ["free", "fixed"])
@pytest.mark.parametrize(
    ("shape", "modes"),
    [(square, square_modes), (lambda n: aslant(n, 0.5), square_modes), (disk, disk_modes)],
    ids=["square", "aslant", "disk"],
)
def test_eigenvalues_converge_at_second_order(shape, modes, rim: str) -> None:
    exact, errors = modes(rim)[1 : MODES + 1], []
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
        waves = WaveSolver(texel_atlas(texels), Material(), backend=backend, rim="fixed", conserve_volume=False)
        waves.height = mode
        waves.step(waves.stable_timestep, 1)
        energy = waves.energy()
        waves.height, waves.velocity = mode, 0.0
        period = 2 / np.sqrt(5)
        steps = int(np.ceil(period / waves.stable_timestep))
        waves.step(period, steps)
        errors.append(np.abs(waves.height - mode).max())
        assert waves.energy() == pytest.approx(energy, rel=0.01)
    assert np.log2(errors[0] / errors[1]) > 1.8 and np.log2(errors[1] / errors[2]) > 1.8


@pytest.mark.parametrize(
    "material",
    [
        Material(speed=0.0, bending=1.0),
        Material(viscosity=0.05, stiffness=20.0),
        Material(density=2.0, yield_height=0.02, stiffness=50.0),
    ],
    ids=["plate", "viscous", "plastic"],
)
def test_both_backends_agree_at_a_fixed_rim(gl_backend: str, material: Material) -> None:
    fields = []
    for backend in ("cpu", gl_backend):
        waves = WaveSolver(texel_atlas(polygon(5, 12)), material, backend=backend, rim="fixed")
        waves.add_impulse([0.3, 0.2, 0], 0.1, 0.3)
        waves.step(100 * waves.stable_timestep)
        fields.append(waves.height)
    assert np.abs(fields[0]).max() > 0
    np.testing.assert_allclose(fields[1], fields[0], atol=1e-4 * np.abs(fields[0]).max())


def test_a_plate_on_a_fixed_rim_has_the_square_of_the_drums_frequencies() -> None:
    texels = square(48)
    x, y, _ = np.moveaxis(texels.positions, -1, 0)
    mode = np.sin(np.pi * x) * np.sin(np.pi * y)
    plate = Material(speed=0.0, bending=1.0)
    waves = WaveSolver(texel_atlas(texels), plate, backend="cpu", rim="fixed", conserve_volume=False)
    waves.height = mode
    waves.step(2 * np.pi / (2 * np.pi**2))
    assert np.abs(waves.height - mode).max() < 0.02


def test_a_surface_that_ends_at_its_last_texels_is_fixed_there() -> None:
    errors = []
    for n in (13, 25, 49):
        x, y = np.meshgrid(*2 * [np.linspace(0, 1, n)])
        texels = TexelMesh.of(square(n).topology, np.stack([x, y, 0 * x], axis=-1)[None])
        mode = (np.sin(np.pi * x) * np.sin(2 * np.pi * y))[None]
        waves = WaveSolver(texel_atlas(texels), backend="cpu", rim="fixed", conserve_volume=False)
        waves.height = mode
        waves.step(2 / np.sqrt(5))
        assert not waves.height[0, 0].any() and not waves.height[0, :, -1].any()
        errors.append(np.abs(waves.height - mode).max())
    assert np.log2(errors[0] / errors[2]) > 2 * 1.9


def test_waves_come_back_inverted_from_a_fixed_rim_and_upright_from_a_free_one() -> None:
    texels = square(96)
    x = texels.positions[..., 0]
    pulse = np.exp(-(((x - 0.5) / 0.08) ** 2))
    for rim, sign in (("free", 1), ("fixed", -1)):
        waves = WaveSolver(texel_atlas(texels), backend="cpu", rim=rim, conserve_volume=False)
        waves.height, waves.velocity = pulse, 2 * (x - 0.5) / 0.08**2 * pulse
        waves.step(1.0)
        middle = waves.height[0, 48]
        assert middle[np.abs(middle).argmax()] == pytest.approx(sign, abs=0.05)


def test_a_closed_surface_knows_no_rim_and_a_bad_name_is_refused() -> None:
    atlas = sphere_atlas(1.0, 8)
    heights = []
    for rim in ("free", "fixed"):
        waves = WaveSolver(atlas, backend="cpu", rim=rim)
        waves.add_impulse([0, 0, 1], 1.0, 0.5)
        waves.step(0.2)
        heights.append(waves.height)
    np.testing.assert_array_equal(*heights)
    with pytest.raises(SolverError, match="rim 'clamped' does not exist; valid are 'free', 'fixed'"):
        WaveSolver(atlas, backend="cpu", rim="clamped")
