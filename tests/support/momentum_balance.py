"""What bodies and surfaces exchange, by MuJoCo's own account and by that of the bodies' velocities."""

import dataclasses

import mujoco
import numpy as np

# A body that is so many times as heavy as another hardly feels it, and MuJoCo's solvers do not care.
_HEAVY = 1e3
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclasses.dataclass
class Balance:
    """Impulses of one target and one geom that touches it, summed over steps [N s].

    Attributes
    ----------
    given : float
        What `Ripples` reports.
    reported : float
        Normal forces of MuJoCo's contacts, less the pull of suckers, times the time step.
    felt : float
        The same, by the change of momentum of the free body that takes part, where one does.
    exchanged : float
        Sum of the amounts of what is reported: pushes and pulls do not cancel.
    """

    given: float = 0.0
    reported: float = 0.0
    felt: float = 0.0
    exchanged: float = 0.0


class MomentumBalance:
    """Keeps account of the exchange between targets and whatever touches them.

    A free body's change of momentum, less gravity and all contact forces but the normal ones, is what its contacts'
    normal forces gave it. Along their sum it is compared with them.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : list of str

    Attributes
    ----------
    pairs : dict
        `Balance` by the names of a target and what touches it.
    pushes : dict
        Sum of the latest step's normal forces [N, 3] of the first geom on the second, by their names.
    """

    def __init__(self, model: mujoco.MjModel, targets: list[str]) -> None:
        self.model, self.names = model, [model.geom(i).name or f"geom {i}" for i in range(model.ngeom)]
        self.targets = {model.geom(name).id: name for name in targets}
        constrained = set()
        for i in range(model.neq):
            constrained |= {int(model.eq_obj1id[i]), int(model.eq_obj2id[i])}
        self.free = {}
        for joint in np.flatnonzero(model.jnt_type == FREE).tolist():
            body = int(model.jnt_bodyid[joint])
            alone = model.body_mass[body] == model.body_subtreemass[body]
            if body not in constrained and alone:
                self.free[body] = int(model.jnt_dofadr[joint])
        self.pairs: dict[tuple[str, str], Balance] = {}
        self.pushes: dict[tuple[str, str], np.ndarray] = {}
        self._flex_geom = {}
        for flex in range(model.nflex):
            self._flex_geom[flex] = model.geom(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)).id

    def before(self, data: mujoco.MjData) -> None:
        """Keep the velocities that a step begins with."""
        self._velocity = data.qvel.copy()

    def after(self, data: mujoco.MjData, impulses: list) -> None:
        """Account for a step."""
        normal, whole = self._contact_forces(data)
        dt = self.model.opt.timestep
        self.pushes = {
            (self.names[a], self.names[b]): sign * sum(vector for _, vector in forces)
            for (first, second), forces in normal.items()
            for a, b, sign in ((first, second, 1.0), (second, first, -1.0))
        }
        shares = {body: self._share(data, body, normal, whole, dt) for body in self.free}
        for (target, other), forces in normal.items():
            for a, b in ((target, other), (other, target)):
                if a not in self.targets:
                    continue
                pair = self.pairs.setdefault((self.names[a], self.names[b]), Balance())
                reported = sum(force for force, _ in forces) * dt
                if a in self._flex_geom.values() or b in self._flex_geom.values():
                    # contacts with triangles push sideways in pairs: only the sum of their forces is meant
                    reported = float(np.linalg.norm(sum(vector for _, vector in forces))) * dt
                pair.reported += reported
                pair.exchanged += abs(reported)
                share = self._share_of_pair(a, b, shares)
                pair.felt += share * reported
        for impulse in impulses:
            self.pairs.setdefault((impulse.geom, impulse.other), Balance()).given += impulse.impulse

    def _share_of_pair(self, a: int, b: int, shares: dict[int, float]) -> float:
        """By the lighter body of two geoms, if that is free, or else by the heavier, if that feels it."""
        moving = (body for body in self.model.geom_bodyid[[a, b]] if self.model.body_dofnum[body])
        light, *heavy = sorted(moving, key=lambda body: self.model.body_mass[body])
        known = [body for body in (light, *heavy) if self.model.body_mass[body] <= _HEAVY * self.model.body_mass[light]]
        return next((shares[body] for body in known if body in shares), 1.0)

    def _contact_forces(self, data: mujoco.MjData) -> tuple[dict, dict]:
        """Normal forces with their vectors on the second geom, by pair, and the whole forces on each body."""
        normal: dict[tuple[int, int], list] = {}
        whole: dict[int, np.ndarray] = {}
        wrench, pulls = np.zeros(6), self._pulls(data)
        for i, contact in enumerate(data.contact):
            mujoco.mj_contactForce(self.model, data, i, wrench)
            # which the solver's force contains, unlike the geoms' own
            wrench[0] -= pulls[i]
            frame = contact.frame.reshape(3, 3)
            geoms = [
                g if g >= 0 else self._flex_geom[f]
                for g, f in zip(contact.geom.tolist(), contact.flex.tolist(), strict=True)
            ]
            normal.setdefault((geoms[0], geoms[1]), []).append((wrench[0], wrench[0] * frame[0]))
            for geom, sign in zip(geoms, (-1.0, 1.0), strict=True):
                body = int(self.model.geom_bodyid[geom])
                whole[body] = whole.get(body, np.zeros(3)) + sign * (frame.T @ wrench[:3])
        return normal, whole

    def _pulls(self, data: mujoco.MjData) -> np.ndarray:
        """Share of every contact of the forces of suckers on its bodies [N]."""
        pulls, contacts = np.zeros(data.ncon), data.contact
        for sucker in np.flatnonzero(self.model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY).tolist():
            body = self.model.actuator_trnid[sucker, 0]
            mine = (self.model.geom_bodyid[contacts.geom] == body).any(axis=1) & (contacts.exclude < 2)
            pulls[mine] += data.actuator_force[sucker] / max(mine.sum(), 1)
        return pulls

    def _share(self, data: mujoco.MjData, body: int, normal: dict, whole: dict, dt: float) -> float:
        """Change of a free body's momentum over that which its contacts' normal forces account for."""
        if body not in whole:
            return 1.0
        pushed = np.zeros(3)
        for (first, second), forces in normal.items():
            for geom, sign in ((first, -1.0), (second, 1.0)):
                if self.model.geom_bodyid[geom] == body:
                    pushed += sign * sum(vector for _, vector in forces)
        if not np.linalg.norm(pushed) > 0:
            return 1.0
        start, mass = self.free[body], self.model.body_mass[body]
        before, change = self._velocity[start : start + 6], (data.qvel - self._velocity)[start : start + 6] / dt
        usual = mass * (np.abs(self.model.opt.gravity).max() + np.abs(before).max() / dt)
        usual = max([usual, *(np.linalg.norm(force) for force in whole.values())])
        if np.linalg.norm(pushed) < 1e-7 * usual:
            # too weak to be felt among roundings
            return 1.0
        # from the frame's origin, whose velocity a free joint has, to the centre of mass
        rotation, arm = data.xmat[body].reshape(3, 3), data.xipos[body] - data.xpos[body]
        spin = rotation @ before[3:]
        at_centre = change[:3] + np.cross(rotation @ change[3:], arm) + np.cross(spin, np.cross(spin, arm))
        felt = mass * (at_centre - self.model.opt.gravity) - (whole[body] - pushed)
        return float(felt @ pushed / (pushed @ pushed))
