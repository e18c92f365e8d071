"""MuJoCo's accelerations are exact; they are not in the version that pyproject excludes."""

import mujoco
import numpy as np

# bodies on rails that are joined like this have a Hessian with neighbouring rows that look alike
# and are not
JOINED = ((3, 2), (4, 0), (4, 1), (5, 2), (6, 0), (6, 1), (6, 4), (6, 5))
MODEL = f"""<mujoco><option iterations="200" tolerance="0"/><worldbody>
{
    "".join(
        f'<body name="{i}" pos="{i % 5} {i // 5} 0"><joint type="slide" axis="1 .2 .3"/>'
        '<geom size=".1"/></body>'
        for i in range(7)
    )
}</worldbody><equality>
{
    "".join(f'<connect body1="{a}" body2="{b}" anchor=".5 0 0"/>' for a, b in JOINED)
}</equality></mujoco>"""


def test_sparse_and_dense_jacobians_give_the_same_accelerations() -> None:
    """MuJoCo 4.0.0 merges rows of the sparse Cholesky factor that differ."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    velocity = np.random.default_rng(0).normal(size=7)
    accelerations = []
    for model.opt.jacobian in (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE):
        data = mujoco.MjData(model)
        data.qvel = velocity
        mujoco.mj_forward(model, data)
        accelerations.append(data.qacc.copy())
    np.testing.assert_allclose(*accelerations, rtol=1e-6)
