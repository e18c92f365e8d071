"""dm_control's `Physics` and `suite`, where that is not installed."""

import types
from typing import Any

import mujoco


class StandIn:
    """Steps and wraps as dm_control's `Physics` does, where that is not installed."""

    legacy_step = True

    def __init__(self, xml: str) -> None:
        model = mujoco.MjModel.from_xml_string(xml)
        self.model = types.SimpleNamespace(ptr=model)
        self.data = types.SimpleNamespace(ptr=mujoco.MjData(model))
        self.reset()

    def reset(self) -> None:
        mujoco.mj_resetData(self.model.ptr, self.data.ptr)
        mujoco.mj_forward(self.model.ptr, self.data.ptr)

    def step(self, nstep: int = 1) -> None:
        if not self.legacy_step:
            mujoco.mj_step(self.model.ptr, self.data.ptr, nstep)
            return
        mujoco.mj_step2(self.model.ptr, self.data.ptr)
        if nstep > 1:
            mujoco.mj_step(self.model.ptr, self.data.ptr, nstep - 1)
        mujoco.mj_step1(self.model.ptr, self.data.ptr)


def stand_in_suite(xml: str) -> types.ModuleType:
    """A module `dm_control.suite` whose environments all have one model."""

    def load(*_: Any, **__: Any) -> types.SimpleNamespace:
        physics = StandIn(xml)
        spec = types.SimpleNamespace(generate_value=lambda: None)
        calls = {
            "reset": lambda: physics.reset(),
            "step": lambda action: physics.step(5),
            "action_spec": lambda: spec,
        }
        return types.SimpleNamespace(physics=physics, **calls)

    suite = types.ModuleType("dm_control.suite")
    suite.load = load  # type: ignore[attr-defined]
    return suite
