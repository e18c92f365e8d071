"""The shipped landscape is what its module makes, and what MuJoCo reads."""

import mujoco
import numpy as np

from ripple_sim.scenes import terrain


def test_mujoco_reads_the_heights_that_the_module_makes() -> None:
    heights = terrain.terrain()
    assert heights.min() == 0 and heights.max() == 1
    model = mujoco.MjModel.from_xml_path(str(terrain.TERRAIN_FILE.parents[1] / "terrain.xml"))
    np.testing.assert_allclose(model.hfield_data.reshape(heights.shape), heights, atol=1e-6)
