"""The loads on several targets at once."""

import mujoco
import numpy as np

from ripple_sim import Material, Ripples


def test_a_target_gets_the_same_load_whether_others_ripple_or_not() -> None:
    """Three targets and bodies on all of them: those that ripple with others have the same waves, bit for bit."""
    rng = np.random.default_rng(4)
    targets = "".join(
        f'<geom name="{name}" type="box" size="0.3 0.3 0.05" pos="{x} 0 0"/>'
        for name, x in (("left", -0.7), ("middle", 0.0), ("right", 0.7))
    )
    bodies = "".join(
        f'<body pos="{0.7 * (i % 3 - 1) + x:.3f} {y:.3f} {0.1 + 0.02 * i:.3f}"><freejoint/>'
        f'<geom type="{("sphere", "box", "capsule")[i // 3]}" size="0.04 0.04 0.04"/></body>'
        for i, (x, y) in enumerate(rng.uniform(-0.2, 0.2, (9, 2)))
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{targets}{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    names = ("left", "middle", "right")
    options = {"resolution": 16, "backend": "cpu"}
    together = Ripples(model, {name: Material() for name in names}, **options)
    alone = {name: Ripples(model, {name: Material()}, **options) for name in names}
    most = 0
    for _ in range(200):
        mujoco.mj_step(model, data)
        together.step(data)
        for ripples in alone.values():
            ripples.step(data)
        assert [(each.geom, each.other) for each in together.last_impulses] == [
            (each.geom, each.other) for ripples in alone.values() for each in ripples.last_impulses
        ]
        most = max(most, len(together.last_impulses))
    assert most > 6
    for name in names:
        assert together[name].height.any()
        np.testing.assert_array_equal(together[name].height, alone[name][name].height)
