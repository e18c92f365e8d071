"""Random MuJoCo models by seed: shapes, mounts, contacts, solvers, masses, scales."""

import functools

import mujoco
import numpy as np
from mujoco_flags import FLAGS
from mujoco_models import mesh_asset, vector

from ripple_sim import make_collidable
from ripple_sim.scenes.shapes import limbed, peanut

# half-sizes of geoms that are about 1 in radius
SHAPES = {
    "sphere": (1.0,),
    "capsule": (0.6, 0.5),
    "ellipsoid": (1.0, 0.8, 0.6),
    "cylinder": (0.9, 0.5),
    "box": (0.9, 0.7, 0.5),
    "egg": (),
}
# the convex hull, the signed distance field and the flex of a mesh that is not convex
ANIMALS = ("hull", "sdf", "flex")
MOUNTS = {
    "static": "",
    "mocap": "",
    "free": "<freejoint/>",
    "hinge": '<joint type="hinge" axis="{axis}" pos="{anchor}"/>',
    "slide": '<joint type="slide" axis="{axis}" damping="{mass}"/>',
    "ball": '<joint type="ball" pos="{anchor}"/>',
    "chain": '<joint type="hinge" axis="{axis}" pos="{anchor}" stiffness="{mass}"/>',
    "weld": "<freejoint/>",
    "connect": "<freejoint/>",
}
# a link belongs to the target's own tree
HITTERS = ("free", "free", "free", "driven", "mocap", "second target", "link")
# a direct current motor without load is so many times as fast as geoms meet
NO_LOAD = 3.0
INTEGRATORS = {"Euler": 0.3, "implicit": 0.15, "implicitfast": 0.35, "RK4": 0.1, "discrete": 0.1}
# share of the models in which a flag is on
FLAG_SHARES = {
    "override": 0.1,
    "multiccd": 0.5,
    "nativeccd": 0.8,
    "warmstart": 0.8,
    "island": 0.8,
}
# flags that half of the models have on: those that change a motion by its numerics alone. Without
# `actuation` nothing drives the hitters, and `sleep` belongs to the models that are to sleep.
EVEN_FLAGS = [flag for flag in FLAGS if flag not in {*FLAG_SHARES, "actuation", "sleep"}]
SCALES = (1e-3, 0.03, 1.0, 30.0, 1e3)


class RandomModel:
    """A model with a geom "target" and up to three more, "hitter 0" and so on, that are to meet it.

    Lengths are in metres, times in seconds: `size` is half the target's, geoms meet at a `speed`,
    and their contacts have the time constant `stopping`. What is drawn for the scene beyond the
    model comes from `rng`.
    """

    def __init__(self, seed: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.kind = str(rng.choice([*SHAPES, *ANIMALS]))
        self.mount = str(rng.choice(list(MOUNTS)))
        self.size = float(rng.choice(SCALES))
        self.timestep = float(10 ** rng.uniform(np.log10(2e-4), np.log10(8e-3)))
        self.stopping = float(self.timestep * 10 ** rng.uniform(np.log10(2), np.log10(25)))
        self.solref = self._solref()
        # how deep a geom sinks in at most
        depth = self.size * 10 ** rng.uniform(-3, -0.8)
        self.speed = float(depth / (self.timestep + self.stopping))
        self.hitters = [str(rng.choice(HITTERS)) for _ in range(rng.integers(1, 4))]
        self.radii = rng.choice([0.15, 0.3, 0.45], 3) * self.size
        self.ground = (
            str(rng.choice(["plane", "hfield"]))
            if self.mount == "free" and rng.random() < 0.5
            else None
        )
        if self.kind == "sdf" and self.ground == "hfield":
            # which MuJoCo does not collide
            self.ground = "plane"
        self.condim = 1 if self.kind == "flex" else int(rng.choice([1, 3, 4, 6]))
        # a keyframe brings back the beginning; a user's filter lets the last hitter through
        self.sleeps, self.restarted, sticky = rng.random(3) < (0.15, 0.1, 0.15)
        self.refused = len(self.hitters) > 1 and bool(rng.random() < 0.15)
        # share of the usual force at a hit
        self.stickiness = 10 ** rng.uniform(-2, 0) if sticky and self.kind != "flex" else 0.0
        self._meshes: dict[str, str] = {}
        self._actuators = ""
        self.xml = self._xml()

    @property
    def targets(self) -> list[str]:
        """Geoms that are to ripple."""
        return [
            "target",
            *(f"hitter {i}" for i, hitter in enumerate(self.hitters) if hitter == "second target"),
        ]

    def compile(self) -> mujoco.MjModel:
        """The model as MuJoCo compiles it."""
        spec = mujoco.MjSpec.from_string(self.xml)
        if self.kind == "flex":
            make_collidable(spec, "target", "flex")
        for mesh in spec.meshes:
            # of signed distances, which take a quarter of the default's time
            mesh.octree_maxdepth = 5
        return spec.compile()

    def _xml(self) -> str:
        hitters = [(hitter, self._hitter(i, hitter)) for i, hitter in enumerate(self.hitters)]
        moved = "".join(body for hitter, body in hitters if hitter != "link")
        links = "".join(body for hitter, body in hitters if hitter == "link")
        bodies = self._target(links) + moved
        equality = ""
        if self.mount in ("weld", "connect"):
            partner = self.rng.choice(["partner", "world"])
            anchor = f'anchor="{self._vector(self.size)}"' if self.mount == "connect" else ""
            equality = (
                f'<equality><{self.mount} body1="target" body2="{partner}" {anchor}/></equality>'
            )
            bodies += (
                f'<body name="partner" pos="0 0 '
                f'{6 * self.size}"><freejoint/>{self._inertia()}</body>'
            )
        if self.ground:
            shape = 'hfield="hills"' if self.ground == "hfield" else 'size="0 0 1"'
            bodies += f'<geom name="ground" type="{self.ground}" {shape} {self._contact()}/>'
        key = "<keyframe><key/></keyframe>" if self.restarted else ""
        return f"""<mujoco><compiler boundinertia="1e-14" boundmass="1e-9"/>{self._option()}
            <asset>{self._assets()}</asset><worldbody>{bodies}</worldbody>{equality}
            <actuator>{self._actuators}</actuator>{key}</mujoco>"""

    def _target(self, links: str) -> str:
        shape = self._shape(self.kind, self.size, "egg")
        geom = f'<geom name="target" {shape} {self._matter()}/>'
        joint = MOUNTS[self.mount].format(
            axis=self._vector(1.0), anchor=self._vector(self.size), mass=self._mass()
        )
        mocap = 'mocap="true"' if self.mount == "mocap" else ""
        if self.sleeps and self.mount == "free" and not self.ground:
            mocap = 'sleep="init"'
        body = (
            f'<body name="target" quat="{vector(self.rng.standard_normal(4))}" '
            f"{mocap}>{joint}{geom}{links}</body>"
        )
        if self.mount != "chain":
            return body
        return (
            f'<body><joint type="slide" axis="{self._vector(1.0)}"/>{self._inertia()}{body}</body>'
        )

    def _hitter(self, i: int, hitter: str) -> str:
        """Body of what moves by itself, at a place of its own, with its actuators."""
        name = f"hitter {i}"
        place = f'pos="{vector(3 * self.size * np.array([i, 1, 3]))}"'
        shape = self._shape(str(self.rng.choice([*SHAPES, "small sdf"])), self.radii[i], f"egg {i}")
        geom = f'<geom name="{name}" {shape} {self._matter()}/>'
        turned = vector(self.rng.standard_normal(4))
        force = float(self._mass()) * self.speed / self.stopping
        if hitter == "mocap":
            return f'<body name="{name}" {place} quat="{turned}" mocap="true">{geom}</body>'
        if hitter in ("driven", "link"):
            axes = zip("xyz", np.eye(3), strict=True)
            x, y, z = (
                f'<joint name="{axis} {i}" type="slide" axis="{vector(way)}"/>'
                for axis, way in axes
            )
            inertia = self._inertia() if hitter == "link" else ""
            self._drive(i, force)
            if hitter == "link":
                return f'<body>{x}{y}{inertia}<body name="{name}">{z}{geom}</body></body>'
            return f'<body name="{name}" {place}>{x}{y}{z}{geom}</body>'
        if self.stickiness and self.rng.random() < 0.5:
            pull = f'gain="{self.stickiness * force:.4g}"'
            self._actuators += f'<adhesion body="{name}" ctrlrange="0 1" {pull}/>'
        return f'<body name="{name}" {place} quat="{turned}"><freejoint/>{geom}</body>'

    def _drive(self, i: int, force: float) -> None:
        """Motors of three joints with a force [N], or direct current motors."""
        constant = 1 / (NO_LOAD * self.speed)
        motor = "motor"
        matter = f'gear="{force}"'
        if self.rng.random() >= 0.7:
            motor = "dcmotor"
            matter = f'motorconst="{constant:.6g}" resistance="{constant / force:.6g}"'
        self._actuators += "".join(f'<{motor} joint="{axis} {i}" {matter}/>' for axis in "xyz")

    def _matter(self) -> str:
        """Mass and contact parameters of a geom, which may be sticky."""
        mass = self._mass()
        sticky = ""
        if self.stickiness and self.rng.random() < 0.5:
            sticky = f'adhesion="{self.stickiness * float(mass) * self.speed / self.stopping:.4g}"'
        return f'mass="{mass}" {self._contact()} {sticky}'

    def _shape(self, kind: str, radius: float, egg: str) -> str:
        """Type and size of a geom, whose mesh becomes an asset."""
        if kind in SHAPES and kind != "egg":
            return f'type="{kind}" size="{vector(radius * np.array(SHAPES[kind]))}"'
        name, which = ("animal", 1) if kind in ANIMALS else (egg, 0)
        scale = vector(radius * np.ones(3))
        self._meshes[name] = mesh_asset(
            name, *_meshes()[which], f'scale="{scale}" inertia="legacy"'
        )
        return f'type="{"sdf" if "sdf" in kind else "mesh"}" mesh="{name}"'

    def _assets(self) -> str:
        found = "".join(self._meshes.values())
        if self.ground != "hfield":
            return found
        hills = " ".join(map(str, np.random.default_rng(1).integers(0, 3, 49)))
        sizes = vector(self.size * np.array([9, 9, 1, 1]))
        return (
            found + f'<hfield name="hills" nrow="7" ncol="7" size="{sizes}" elevation="{hills}"/>'
        )

    def _vector(self, size: float) -> str:
        return vector(size * self.rng.uniform(-1, 1, 3))

    def _mass(self) -> str:
        return f"{10 ** self.rng.uniform(-6, 6):.4g}"

    def _inertia(self) -> str:
        mass = self._mass()
        inertia = vector(self.size**2 * float(mass) * np.ones(3))
        return f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/>'

    def _solref(self) -> str:
        if self.rng.random() < 0.25:
            # stiffness and damping of their own
            omega = 1 / self.stopping
            ratio = self.rng.uniform(0.05, 1.5)
            return f"{-(omega**2):.5g} {-2 * ratio * omega:.5g}"
        return f"{self.stopping:.5g} {self.rng.uniform(0.1, 1.5):.4g}"

    def _contact(self) -> str:
        rng = self.rng
        small = 0.01 * self.size
        margin, gap = (small * rng.random() if rng.random() < 0.3 else 0.0 for _ in range(2))
        solimp = rng.choice(
            ["0.9 0.95 0.001", f"0.8 0.99 {small:.4g}", "0.95 0.99 0.001 0.3 3", "0.5 0.9 0.01"]
        )
        friction = (
            f"{rng.uniform(0, 1.5):.3g} {small * rng.uniform(0, 2):.3g} {small * rng.random():.3g}"
        )
        return (
            f'condim="{self.condim}" solref="{self.solref}" solimp="{solimp}" '
            f'margin="{margin:.4g}" gap="{gap:.4g}" '
            f'friction="{friction}" priority="{int(rng.random() < 0.15)}" '
            f'solmix="{rng.uniform(0, 2):.3g}"'
        )

    def _option(self) -> str:
        rng = self.rng
        solver = rng.choice(["Newton", "CG", "PGS"], p=(0.5, 0.25, 0.25))
        cone = rng.choice(["pyramidal", "elliptic"])
        integrator = rng.choice(list(INTEGRATORS), p=list(INTEGRATORS.values()))
        if integrator == "discrete" and (
            solver == "PGS" or not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE")
        ):
            integrator = "implicitfast"
        flags = {flag: rng.random() < share for flag, share in FLAG_SHARES.items()}
        flags["sleep"] = self.sleeps
        more = rng.spawn(1)[0]
        flags |= {flag: more.random() < 0.5 for flag in EVEN_FLAGS}
        flags["invdiscrete"] &= integrator != "RK4"
        jacobian = more.choice(["dense", "sparse", "auto"])
        noslip = more.choice([0, 0, 5])
        text = " ".join(f'{flag}="{"enable" if on else "disable"}"' for flag, on in flags.items())
        overrides = (
            f'o_solref="{self._solref()}" o_solimp="0.9 0.95 0.001 0.5 2"'
            if flags["override"]
            else ""
        )
        gravity = vector(
            0.1 * self.speed / self.stopping * rng.standard_normal(3) * (rng.random() < 0.5)
        )
        return f"""<option timestep="{self.timestep:.6g}" integrator="{integrator}"
          solver="{solver}" cone="{cone}"
            jacobian="{jacobian}" noslip_iterations="{noslip}" gravity="{gravity}"
            sdf_initpoints="50" impratio="{rng.choice([1, 1, 10])}" {overrides}>
            <flag {text}/></option>"""


@functools.cache
def _meshes() -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """An egg and an animal of a half-size of about 1."""
    V, F = peanut(0.08)
    animal, triangles = limbed(0.06)
    egg = V / np.linalg.norm(V, axis=1, keepdims=True) * [1.0, 0.8, 0.7]
    return (egg, F), (2.0 * (animal - animal.mean(axis=0)), triangles)
