"""Momentum that bodies and surfaces exchange, by MuJoCo and by the bodies' velocities."""

import collections
import dataclasses

import mujoco
import numpy as np
from hits import contact_forces

# A body that is so many times as heavy as another hardly feels it, and MuJoCo's solvers do not
# care.
_HEAVY = 1e3


@dataclasses.dataclass
class Balance:
    """Impulses of one target and one geom that touches it, summed over steps [N s]."""

    given: float = 0.0  # what `Ripples` reports
    # normal forces of MuJoCo's contacts, less the pull of suckers, times the time step
    reported: float = 0.0
    # the same, by the change of momentum of the free body that takes part, where one does
    felt: float = 0.0
    exchanged: float = 0.0  # sum of the amounts of what is reported: pushes and pulls do not cancel


class MomentumBalance:
    """Keeps account of the momentum that targets exchange with the bodies that touch them.

    The change of momentum of a free body, less gravity and the friction of its contacts, is the
    impulse of its normal forces. The two are compared along the sum of the normal forces.
    """

    def __init__(self, model: mujoco.MjModel, targets: list[str]) -> None:
        self.model = model
        self.names = [model.geom(i).name or f"geom {i}" for i in range(model.ngeom)]
        # by the names of a target and what touches it
        self.pairs: dict[tuple[str, str], Balance] = collections.defaultdict(Balance)
        # sum of the latest step's normal forces [N, 3] of the first geom on the second, by their
        # names
        self.pushes: dict[tuple[str, str], np.ndarray] = {}
        self._targets = targets
        flexes = (
            mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) for flex in range(model.nflex)
        )
        self._flexed = np.array([model.geom(name).id for name in flexes], int)
        free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        tied = np.isin(free, [model.eq_obj1id, model.eq_obj2id])
        self._free = free[~tied & (model.body_mass[free] == model.body_subtreemass[free])].tolist()

    def before(self, data: mujoco.MjData) -> None:
        """Keep the velocities that a step begins with."""
        self._velocity = data.qvel.copy()

    def after(self, data: mujoco.MjData, impulses: list) -> None:
        """Account for a step."""
        dt = self.model.opt.timestep
        geoms = data.contact.geom.copy()
        forces = contact_forces(self.model, data)[:, :3]
        by_flex = geoms < 0
        geoms[by_flex] = self._flexed[data.contact.flex[by_flex]]
        # which the solver's force contains, unlike the geoms' own
        forces[:, 0] -= self._pulls(data)
        frames = data.contact.frame.reshape(-1, 3, 3)
        vectors = np.stack(
            [forces[:, :1] * frames[:, 0], np.einsum("ki,kij->kj", forces, frames)], axis=1
        )
        on_bodies = np.zeros((self.model.nbody, 2, 3))  # normal forces, and whole ones
        np.add.at(on_bodies, self.model.geom_bodyid[geoms[:, 1]], vectors)
        np.subtract.at(on_bodies, self.model.geom_bodyid[geoms[:, 0]], vectors)
        largest = np.linalg.norm(on_bodies[:, 1], axis=1).max()
        shares = {body: self._share(data, body, *on_bodies[body], largest) for body in self._free}
        self.pushes = {}
        for pair in np.unique(geoms, axis=0):
            mine = (geoms == pair).all(axis=1)
            (a, b) = (self.names[geom] for geom in pair)
            push = vectors[mine, 0].sum(axis=0)
            reported = dt * forces[mine, 0].sum()
            if np.isin(pair, self._flexed).any():
                # contacts with triangles push sideways in pairs: only the sum of their forces is
                # meant
                reported = dt * float(np.linalg.norm(push))
            self.pushes |= {(a, b): push, (b, a): -push}
            for names in ((a, b), (b, a)):
                if names[0] in self._targets:
                    account = self.pairs[names]
                    account.reported += reported
                    account.exchanged += abs(reported)
                    account.felt += reported * self._share_of_pair(pair, shares)
        for impulse in impulses:
            self.pairs[impulse.geom, impulse.other].given += impulse.impulse

    def _share_of_pair(self, pair: np.ndarray, shares: dict[int, float]) -> float:
        """Momentum by the lighter of two bodies if it is free, else by the heavier."""
        mass = self.model.body_mass
        moving = (
            body for body in self.model.geom_bodyid[pair].tolist() if self.model.body_dofnum[body]
        )
        light, *heavy = sorted(moving, key=lambda body: mass[body])
        known = [light, *(body for body in heavy if mass[body] <= _HEAVY * mass[light])]
        return next((shares[body] for body in known if body in shares), 1.0)

    def _pulls(self, data: mujoco.MjData) -> np.ndarray:
        """Share of every contact of the forces of suckers on its bodies [N]."""
        pulls = np.zeros(data.ncon)
        contacts = data.contact
        for sucker in np.flatnonzero(
            self.model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY
        ).tolist():
            body = self.model.actuator_trnid[sucker, 0]
            mine = (self.model.geom_bodyid[contacts.geom] == body).any(axis=1) & (
                contacts.exclude < 2
            )
            pulls[mine] += data.actuator_force[sucker] / max(mine.sum(), 1)
        return pulls

    def _share(
        self, data: mujoco.MjData, body: int, pushed: np.ndarray, whole: np.ndarray, largest: float
    ) -> float:
        """A free body's change of momentum that its contacts' normal forces do not explain."""
        start = self.model.body_dofadr[body]
        mass = self.model.body_mass[body]
        gravity = self.model.opt.gravity
        dof = slice(start, start + 6)
        dt = self.model.opt.timestep
        before = self._velocity[dof]
        change = (data.qvel - self._velocity)[dof] / dt
        usual = max(largest, mass * (np.abs(gravity).max() + np.abs(before).max() / dt))
        if np.linalg.norm(pushed) <= 1e-7 * usual:
            # nothing, or too weak to be felt among roundings
            return 1.0
        # from the frame's origin, whose velocity a free joint has, to the centre of mass
        rotation = data.xmat[body].reshape(3, 3)
        arm = data.xipos[body] - data.xpos[body]
        spin = rotation @ before[3:]
        at_centre = (
            change[:3] + np.cross(rotation @ change[3:], arm) + np.cross(spin, np.cross(spin, arm))
        )
        felt = mass * (at_centre - gravity) - (whole - pushed)
        return float(felt @ pushed / (pushed @ pushed))
