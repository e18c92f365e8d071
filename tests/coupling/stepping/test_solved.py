"""Forces that belong to other contacts are told from those that MuJoCo solved for, whatever solves."""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.stepping.solved import SolvedForces

TUMBLING = """<mujoco><option solver="{}" integrator="{}" noslip_iterations="{}"><flag sleep="{}"/></option><worldbody>
<geom type="plane" size="2 2 1"/><geom type="box" size="0.6 0.1 0.1" pos="0 0.2 0.1"/>
<body pos="0 0 0.2"><freejoint/><geom type="box" size="0.1 0.08 0.06"/></body>
<body pos="0.05 0 0.4"><freejoint/><geom type="capsule" size="0.05 0.1"/></body>
<body pos="0.3 0.1 0.4"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("solver", ["PGS", "CG", "Newton"])
@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize(("noslip", "sleep"), [(0, "disable"), (3, "disable"), (0, "enable")])
def test_forces_after_a_step_are_solved(solver: str, integrator: str, noslip: int, sleep: str) -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format(solver, integrator, noslip, sleep))
    data = mujoco.MjData(model)
    solved = SolvedForces(model)
    for _ in range(400):
        mujoco.mj_step(model, data)
        assert solved.of(data) == (data, False)


def test_forces_of_the_step_before_are_not() -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format("Newton", "Euler", 0, "disable"))
    data, solved, found_unsolved = mujoco.MjData(model), SolvedForces(model), 0
    mujoco.mj_step1(model, data)
    for _ in range(200):
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        if not data.nefc:
            continue
        ahead, solved_here = solved.of(data)
        found_unsolved += solved_here
        if solved_here:
            forces = ahead.efc_force.copy()
            mujoco.mj_step2(model, data)
            np.testing.assert_allclose(forces, data.efc_force, rtol=1e-6, atol=1e-6)
            # solving again changes nothing
            np.testing.assert_allclose(solved.of(data)[0].efc_force, data.efc_force, rtol=1e-6, atol=1e-6)
            mujoco.mj_step1(model, data)
    assert found_unsolved > 20
