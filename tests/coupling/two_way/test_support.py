"""Support points of geoms against the definition: no point of the geom lies farther in the direction."""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.two_way import support_point

GEOMS = {
    "sphere": 'type="sphere" size="0.3"',
    "ellipsoid": 'type="ellipsoid" size="0.3 0.2 0.1"',
    "capsule": 'type="capsule" size="0.1 0.3"',
    "cylinder": 'type="cylinder" size="0.2 0.3"',
    "box": 'type="box" size="0.3 0.2 0.1"',
    "mesh": 'type="mesh" mesh="tetrahedron"',
}


def geom_model(kind: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><asset><mesh name="tetrahedron" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
        <worldbody><geom {GEOMS[kind]}/></worldbody></mujoco>"""
    )


@pytest.mark.parametrize("kind", GEOMS)
def test_rays_meet_no_point_that_lies_farther(kind: str) -> None:
    model = geom_model(kind)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rotation, origin = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    rng, geom = np.random.default_rng(3), np.zeros(1, dtype=np.int32)

    def height(point: np.ndarray, direction: np.ndarray) -> float:
        """Of what a ray against the direction through a point meets first; -inf if nothing."""
        start = point + 3.0 * direction
        away = mujoco.mj_ray(model, data, origin + rotation @ start, -rotation @ direction, None, 1, -1, geom)
        return float(start @ direction) - away if away >= 0 else -np.inf

    for direction in rng.standard_normal((20, 3)):
        direction /= np.linalg.norm(direction)
        farthest = support_point(model, 0, direction)
        aside = rng.uniform(-0.5, 0.5, (200, 3))
        assert max(height(farthest + offset, direction) for offset in aside) <= farthest @ direction + 1e-3
        # and it is a point of the geom: a ray just inside its rim meets it
        assert height(0.999 * farthest, direction) == pytest.approx(farthest @ direction, abs=5e-3)


def test_middle_of_a_face_that_lies_flat() -> None:
    down = np.array([0.005, -0.004, -1.0])
    np.testing.assert_allclose(support_point(geom_model("box"), 0, down), [0, 0, -0.1])
    np.testing.assert_allclose(support_point(geom_model("cylinder"), 0, down), [0, 0, -0.3])
    np.testing.assert_allclose(support_point(geom_model("capsule"), 0, np.array([0.0, 1.0, 0.01])), [0, 0.1, 0.001])
