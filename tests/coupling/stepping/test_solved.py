"""Forces of the step before are not taken for those of the present contacts, whatever solves and integrates."""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.stepping import SolvedForces

TUMBLING = """<mujoco><option solver="{}" integrator="{}" noslip_iterations="{}"><flag sleep="{}"/></option><worldbody>
<geom type="plane" size="2 2 1"/><geom type="box" size="0.6 0.1 0.1" pos="0 0.2 0.1"/>
<body pos="0 0 0.2"><freejoint/><geom type="box" size="0.1 0.08 0.06"/></body>
<body pos="0.05 0 0.4"><freejoint/><geom type="capsule" size="0.05 0.1"/>
<body pos="0 0 0.2"><joint/><geom size="0.06"/></body></body>
<body mocap="true" pos="0.3 0.1 0.1"><geom size="0.1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("solver", ["PGS", "CG", "Newton"])
@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize(("noslip", "sleep"), [(0, "disable"), (3, "disable"), (0, "enable")])
def test_data_after_a_step_is_taken_as_it_is(solver: str, integrator: str, noslip: int, sleep: str) -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format(solver, integrator, noslip, sleep))
    data = mujoco.MjData(model)
    solved = SolvedForces(model)
    for step in range(400):
        data.mocap_pos[0, 2] = 0.1 + 0.05 * np.sin(0.1 * step)
        mujoco.mj_step(model, data)
        assert solved.of(data) == (data, False)


def test_forces_of_the_next_step_are_solved_for() -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format("Newton", "Euler", 0, "disable"))
    data, solved, found_unsolved = mujoco.MjData(model), SolvedForces(model), 0
    mujoco.mj_step1(model, data)
    for _ in range(200):
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        ahead, unsolved = solved.of(data)
        found_unsolved += unsolved
        forces = ahead.efc_force.copy()
        mujoco.mj_step2(model, data)
        np.testing.assert_allclose(forces, data.efc_force, rtol=1e-6, atol=1e-6)
        mujoco.mj_step1(model, data)
    assert found_unsolved > 20


def test_forces_that_are_solved_come_out_the_same() -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format("Newton", "Euler", 0, "disable"))
    data, solved = mujoco.MjData(model), SolvedForces(model)
    for _ in range(200):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        found, unsolved = solved.of(data)
        assert not unsolved
        np.testing.assert_allclose(found.efc_force, data.efc_force, rtol=1e-6, atol=1e-6)
