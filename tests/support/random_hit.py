"""A random model at the moment before its geoms meet, and what drives them."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from random_models import RandomModel

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


class RandomHit:
    """A random model whose hitters are some steps away from the target, on their way to it.

    Parameters
    ----------
    random : RandomModel

    Attributes
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    steps : int
        After which the first hit is over.
    """

    def __init__(self, random: RandomModel) -> None:
        self._random, self.model = random, random.compile()
        self.data = mujoco.MjData(self.model)
        self.steps = int(min(250, 12 + 6 * random.stopping / random.timestep))
        mujoco.mj_fwdPosition(self.model, self.data)
        ways = [self._send(f"hitter {i}") for i in range(len(random.hitters))]
        self._drift = -ways[0] * random.speed
        if random.ground:
            self._lay_ground()
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """Let motors push, mocap bodies move on, and MuJoCo take a step."""
        data, model = self.data, self.model
        towards = self._drift / np.linalg.norm(self._drift)
        data.ctrl[:] = towards[np.arange(model.nu) % 3]
        first = model.body("hitter 0").mocapid[0]
        for mocap in range(model.nmocap):
            data.mocap_pos[mocap] += self._drift * model.opt.timestep * (1.0 if mocap == first else -0.3)
        mujoco.mj_step(model, data)

    def _send(self, name: str) -> np.ndarray:
        """Place a body near the target, and give it its speed; the direction that it comes from."""
        random, rng, model, data = self._random, self._random.rng, self.model, self.data
        way = rng.standard_normal(3)
        if random.ground:
            way[2] = abs(way[2]) + 0.5
        way /= np.linalg.norm(way)
        aim = data.geom("target").xpos + 0.2 * random.size * rng.uniform(-1, 1, 3)
        gap = random.speed * random.timestep * rng.uniform(2, 8)

        def touch(distance: float) -> bool:
            self._move(name, aim + distance * way)
            return self._touch(name)

        self._move(name, aim + (_first_touch(touch, 3 * random.size) + gap) * way)
        joint = model.body(name).jntadr[0]
        if joint >= 0 and model.jnt_type[joint] == _FREE:
            velocity = data.qvel[model.jnt_dofadr[joint] :][:6]
            velocity[:] = [*(-random.speed * way), *(rng.uniform(-0.5, 0.5, 3) * random.speed / random.size)]
        return way

    def _lay_ground(self) -> None:
        """Lay the ground below the target, which falls onto it."""
        random, model = self._random, self.model
        height = model.geom("ground").pos

        def touch(distance: float) -> bool:
            height[2] = -distance
            return self._touch("ground")

        height[2] = -_first_touch(touch, 5 * random.size) - 3 * random.speed * random.timestep
        self.data.qvel[model.jnt_dofadr[model.body("target").jntadr[0]] + 2] = -random.speed

    def _move(self, name: str, place: np.ndarray) -> None:
        model, data, body = self.model, self.data, self.model.body(name)
        if body.mocapid[0] >= 0:
            data.mocap_pos[body.mocapid[0]] = place
            return
        joint = body.jntadr[0]
        where = data.qpos[model.jnt_qposadr[joint] :][:3]
        where[:] = place if model.jnt_type[joint] == _FREE else place - body.pos

    def _touch(self, name: str) -> bool:
        """Whether a geom touches the target, or the flex that collides for it."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        geom, target = self.model.geom(name).id, self.model.geom("target").id
        return any(
            geom in contact.geom and (target in contact.geom or max(contact.flex) >= 0) for contact in self.data.contact
        )


def _first_touch(touch: Callable[[float], bool], far: float) -> float:
    """Distance at which something that comes from afar begins to touch."""
    step = far / 60
    while far > 0 and not touch(far - step):
        far -= step
    near = far - step
    for _ in range(30):
        middle = (near + far) / 2
        near, far = (middle, far) if touch(middle) else (near, middle)
    return far
