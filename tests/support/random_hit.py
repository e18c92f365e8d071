"""A random model at the moment before its geoms meet, and what drives them."""

import contextlib
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
from random_models import RandomModel

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


class RandomHit:
    """A random model whose hitters approach the target; the first hit ends after `steps`."""

    def __init__(self, random: RandomModel) -> None:
        self._random = random
        self.model = random.compile()
        self.data = mujoco.MjData(self.model)
        self.steps = int(min(250, 12 + 6 * random.stopping / random.timestep))
        mujoco.mj_fwdPosition(self.model, self.data)
        self._drive([self._send(f"hitter {i}") for i in range(len(random.hitters))])
        if random.ground:
            self._lay_ground()
        mujoco.mj_forward(self.model, self.data)
        if random.restarted:
            mujoco.mj_setKeyframe(self.model, self.data, 0)

    def step(self) -> None:
        """Let mocap bodies move on, and MuJoCo take a step."""
        self.data.mocap_pos += self._drift * self.model.opt.timestep
        mujoco.mj_step(self.model, self.data)

    @contextlib.contextmanager
    def filtering(self) -> Iterator[None]:
        """Refuse the contacts of the last hitter with the target, where the model says so."""
        if self._random.refused:
            pair = {
                self.model.geom(name).id
                for name in ("target", f"hitter {len(self._random.hitters) - 1}")
            }
            mujoco.set_mjcb_contactfilter(lambda model, data, one, other: int({one, other} == pair))
        try:
            yield
        finally:
            mujoco.set_mjcb_contactfilter(None)

    def restart(self) -> None:
        """Go back to the beginning."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        mujoco.mj_forward(self.model, self.data)

    def _drive(self, ways: list[np.ndarray]) -> None:
        """Switch motors and suckers on towards the target; choose mocap velocities [m/s]."""
        model = self.model
        self._drift = np.zeros((self.model.nmocap, 3))
        driven = {f"hitter {i}": -way for i, way in enumerate(ways)} | {"target": 0.3 * ways[0]}
        for name, way in driven.items():
            if model.body(name).mocapid[0] >= 0:
                self._drift[model.body(name).mocapid[0]] = way * self._random.speed
        self.data.ctrl[:] = 1.0
        for motor in np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).tolist():
            axis, hitter = model.joint(int(model.actuator_trnid[motor, 0])).name.split()
            parent = model.body_parentid[model.joint(f"x {hitter}").bodyid[0]]
            along = self.data.xmat[parent].reshape(3, 3)[:, "xyz".index(axis)]
            self.data.ctrl[motor] = -ways[int(hitter)] @ along

    def _send(self, name: str) -> np.ndarray:
        """Place a body near the target, and give it its speed; the direction that it comes from."""
        random = self._random
        rng = self._random.rng
        model = self.model
        data = self.data
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
            velocity[:] = [
                *(-random.speed * way),
                *(rng.uniform(-0.5, 0.5, 3) * random.speed / random.size),
            ]
        return way

    def _lay_ground(self) -> None:
        """Lay the ground below the target, which falls onto it."""
        random = self._random
        model = self.model
        height = model.geom("ground").pos

        def touch(distance: float) -> bool:
            height[2] = -distance
            return self._touch("ground")

        height[2] = -_first_touch(touch, 5 * random.size) - 3 * random.speed * random.timestep
        self.data.qvel[model.jnt_dofadr[model.body("target").jntadr[0]] + 2] = -random.speed

    def _move(self, name: str, place: np.ndarray) -> None:
        model = self.model
        data = self.data
        body = self.model.body(name)
        joint = int(body.jntadr[0])
        if body.mocapid[0] >= 0:
            data.mocap_pos[body.mocapid[0]] = place
        elif model.jnt_type[joint] == _FREE:
            data.qpos[model.jnt_qposadr[joint] :][:3] = place
        else:  # on three slides, two of them a parent's of a link
            x = model.joint("x " + name.split()[1])
            parent = model.body_parentid[x.bodyid[0]]
            local = (place - data.xpos[parent]) @ data.xmat[parent].reshape(3, 3)
            data.qpos[x.qposadr[0] :][:3] = local - model.body_pos[x.bodyid[0]]

    def _touch(self, name: str) -> bool:
        """Whether a geom touches the target, or the flex that collides for it."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        geom = self.model.geom(name).id
        target = self.model.geom("target").id
        contacts = self.data.contact
        met = (contacts.geom == target).any(axis=1) | (contacts.flex >= 0).any(axis=1)
        return bool((met & (contacts.geom == geom).any(axis=1)).any())


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
