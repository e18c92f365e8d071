"""What the high-pass leaves of a load: nothing coarse."""

import mujoco
import numpy as np
import pytest

from ripple_sim import Ripples
from ripple_sim.coupling.soft import HighPass, SoftSurface, coarse_motions, first_flex
from ripple_sim.solver import Load, Material


def flexed(dof: str) -> tuple[mujoco.MjModel, Ripples, SoftSurface]:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><flexcomp name="jelly" type="grid" count="3 3 3" spacing=".1 .1 .1" dim="3" dof="{dof}"
        radius=".005" mass="5"><contact selfcollide="none"/><elasticity young="4e3" poisson=".3"/></flexcomp>
        </worldbody></mujoco>"""
    )
    ripples = Ripples(model, {"jelly": Material(speed=1.0, density=5.0)}, resolution=8, high_pass={"jelly": True})
    return model, ripples, SoftSurface(model, first_flex(model))


@pytest.mark.parametrize("dof", ["full", "trilinear"])
def test_what_is_left_does_no_work_on_the_motions_of_the_flex(dof):
    _, ripples, surface = flexed(dof)
    waves = ripples["jelly"]
    texels = np.arange(40)
    load = Load(texels, np.linspace(1, 2, 40))
    fine = HighPass(waves, surface)(load)
    basis = coarse_motions(waves, surface)
    assert np.abs(basis.T @ fine.forces).max() < 1e-6 * np.abs(load.forces).sum()
    assert np.abs(fine.forces).max() > 0.1


def test_a_coarse_load_is_taken_off_whole():
    _, ripples, surface = flexed("trilinear")
    waves = ripples["jelly"]
    mass = waves.operator.mass.reshape(-1)
    motion = waves.rest.normals.reshape(-1, 3) @ [1.0, 2.0, 3.0]
    fine = HighPass(waves, surface)(Load(np.arange(len(mass)), mass * motion))
    assert np.abs(fine.forces).max() < 1e-6 * np.abs(mass * motion).max()


def test_no_load_stays_none():
    _, ripples, surface = flexed("trilinear")
    assert not len(HighPass(ripples["jelly"], surface)(Load.none()).texels)
